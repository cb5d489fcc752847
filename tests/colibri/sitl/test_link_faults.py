"""The same flights in memory and as processes over UDP; what dies there; what bad links do, and what they do not."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from random import Random
from typing import Any

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.mavlink.hil.conductor import Gathering, Parcel, StepMessage, packets
from colibri.sitl.backends.launcher import Launcher, one_core
from colibri.sitl.backends.link_faults import Pipe, SessionError, Trouble
from colibri.sitl.backends.setting import Setting
from colibri.sitl.errors import SitlError
from colibri.sitl.session import Flights
from colibri.sitl.vehicle import Sitl

IN_WIND = {"wind": "3@270", "turbulence": "light", "seed": 3}
CORES = "import os; print(*os.sched_getaffinity(0))"
BAD = {"loss": 0.2, "duplicate": 0.1, "reorder": 0.1, "corrupt": 0.1, "jitter_s": 0.004}


@pytest.fixture(scope="module")
def forked() -> Iterator[Launcher]:
    launcher = Launcher()
    yield launcher
    launcher.close()


def up_and_on(sitl: Sitl) -> None:
    sitl.set_param("RTL_RETURN_ALT", 7.0)
    items = sitl.items
    sitl.upload_mission([items.takeoff(1.0), items.waypoint(1.0, 0.5, 1.5)])
    sitl.start_mission()
    sitl.run(2.0)
    sitl.kill_autopilot()
    sitl.run(0.5)
    sitl.inject("motor", "wrong", 1, 0.9)
    with pytest.raises(sitl.Refused):
        sitl.inject("system_avoidance", "off")
    sitl.wind, sitl.payload_kg = "12@270", 0.3
    sitl.run(0.3)


def flown(launcher: Launcher | None, fly: Callable[[Sitl], object], **setting: Any) -> tuple[str, list[str]]:
    with Flights(Setting(**setting), launcher) as flights:
        sitl = flights.begin()
        fly(sitl)
        return sitl.sha256, sitl.texts


@pytest.mark.parametrize("feedback", ["sensors", pytest.param("state", marks=pytest.mark.long)])
def test_the_same_flight_over_udp(forked: Launcher, feedback: str) -> None:
    in_memory = flown(None, up_and_on, feedback=feedback, **IN_WIND)
    assert flown(forked, up_and_on, feedback=feedback, **IN_WIND) == in_memory
    assert any("Takeoff" in text for text in in_memory[1])


@pytest.mark.long
def test_the_same_flight_of_processes_from_scratch() -> None:
    def hover(sitl: Sitl) -> None:
        sitl.run(0.2)

    assert flown(Launcher(from_scratch=True), hover, airborne=2.0) == flown(None, hover, airborne=2.0)


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system binds no process to a core")
def test_each_worker_keeps_to_one_core() -> None:
    def cores_of(worker: int, workers: int) -> list[set[int]]:
        with one_core(worker, workers):
            started = subprocess.run([sys.executable, "-c", CORES], capture_output=True, text=True, check=True)
            return [os.sched_getaffinity(0), set(map(int, started.stdout.split()))]

    cores = sorted(os.sched_getaffinity(0))
    last = len(cores) - 1
    assert cores_of(last, len(cores)) == [{cores[last]}] * 2
    assert cores_of(len(cores), 2 * len(cores)) == [{cores[0]}] * 2
    assert os.sched_getaffinity(0) == set(cores)
    assert cores_of(0, 0) == [set(cores)] * 2
    if last:
        assert cores_of(0, len(cores) + 1) == [set(cores)] * 2


def test_another_process_cannot_be_seen_inside(forked: Launcher) -> None:
    with Flights(Setting(airborne=3.0), forked) as flights, pytest.raises(SitlError, match="--sitl-link memory"):
        assert flights.begin().inside


@pytest.mark.parametrize("processes", [False, pytest.param(True, marks=pytest.mark.long)])
def test_a_bad_plant_link_changes_no_flight(forked: Launcher, processes: bool) -> None:
    def fly(sitl: Sitl) -> None:
        sitl.goto(0.3, 0.0, 3.0, wait=False)
        sitl.run(0.5)

    def fly_badly(sitl: Sitl) -> None:
        for name, value in BAD.items():
            setattr(sitl.link.plant, name, value)
        fly(sitl)

    launcher = forked if processes else None
    assert flown(launcher, fly_badly, airborne=3.0) == flown(None, fly, airborne=3.0)


@pytest.mark.sitl(airborne=3.0)
def test_a_flight_over_a_link_that_carries_nothing_ends(sitl: Sitl) -> None:
    sitl.link.plant.down = True
    with pytest.raises(SessionError, match="no message passes between plant and autopilot"):
        sitl.step()


@pytest.mark.sitl(airborne=3.0)
def test_sticks_are_held_whatever_is_done_meanwhile(sitl: Sitl) -> None:
    sitl.link.ground.loss, sitl.link.ground.jitter_s = 0.3, 0.05
    with sitl.sticks_held():
        sitl.run(0.3)
        sitl.select(Mode.POSITION)
        with sitl.sticks_held(pitch=1.0):
            sitl.run(1.0)
        assert sitl.velocity[1] > 1.0
        sitl.wait_until(lambda: sitl.speed_m_s < 0.1, within=4.0)
        assert sitl.mode is Mode.POSITION
    sitl.wait_until(lambda: sitl.mode is Mode.HOLD, within=0.7)


@pytest.mark.sitl(airborne=3.0)
def test_what_the_vehicle_says_is_known_though_the_link_loses_it(sitl: Sitl) -> None:
    sitl.link.ground.down = True
    sitl.inject("motor", "off", 2)
    sitl.run(0.3)
    assert sitl.said("rotor 2 failed")
    assert not sitl.gcs.said("rotor 2 failed")


def blown_and_laden(sitl: Sitl) -> None:
    sitl.run(0.2)
    sitl.wind = "12@270"
    sitl.run(0.3)
    sitl.payload_kg = 0.3
    sitl.run(0.3)
    sitl.wind, sitl.payload_kg = None, 0.0
    sitl.run(0.2)


@pytest.mark.sitl(airborne=3.0)
def test_wind_and_payload_change_in_flight(sitl: Sitl) -> None:
    blown_and_laden(sitl)
    t, east, up = (sitl.flown()[name] for name in ("t", "vx", "vz"))
    assert east[t < 0.2].max() < 0.1 < east.max()
    assert up[t < 0.5].min() - 0.1 > up.min()
    assert (sitl.wind, sitl.payload_kg) == ("0.0@0.0", 0.0)


@pytest.mark.sitl(airborne=3.0)
def test_a_world_that_there_is_not_is_refused(sitl: Sitl) -> None:
    with pytest.raises(ValueError, match="wind must be SPEED@FROM in m/s and degrees, for example 5@270, not west"):
        sitl.wind = "west"
    with pytest.raises(ValueError, match="payload_kg must be from 0 to 100, not -1"):
        sitl.payload_kg = -1


@pytest.mark.parametrize("package", ["plant", "autopilot"])
def test_a_process_that_dies_is_named(forked: Launcher, package: str) -> None:
    launcher = Launcher(from_scratch=True) if package == "plant" else forked
    with Flights(Setting(airborne=3.0), launcher) as flights:
        sitl = flights.begin()
        sitl.run(0.1)
        os.kill(sitl.processes[package], signal.SIGKILL)
        with pytest.raises(SessionError, match=f"the {package} was killed by SIGKILL"):
            sitl.run(1.0)


def test_a_process_that_cannot_begin_is_quoted() -> None:
    with (
        Flights(Setting(vehicle="iris", believed="three"), Launcher(from_scratch=True)) as flights,
        pytest.raises(SessionError, match=r"the autopilot ended with exit code 2: .*unknown vehicle"),
    ):
        flights.begin()


def test_step_messages_come_whole_in_any_order() -> None:
    chance = Random(1)
    parcels = [Parcel(number, chance.randbytes(chance.randrange(1400))) for number in range(20)]
    step_message = StepMessage(12_345_678, parcels, custom_mode=4 << 16, armed=True)
    pieces = packets(step_message)
    assert len(pieces) > 2
    gathering = Gathering()
    gathered = [gathering.take(piece) for piece in reversed(pieces)]
    assert gathered[:-1] == [None] * (len(pieces) - 1)
    assert gathered[-1] == step_message


def test_a_link_is_as_bad_as_it_is_said_to_be() -> None:
    trouble = Trouble(loss=0.3, delay_s=0.1, jitter_s=0.05, duplicate=0.2, corrupt=0.1)
    pipe = Pipe(trouble, "1")
    sent = [number.to_bytes(4, "little") for number in range(4000)]
    for datagram in sent:
        pipe.put(datagram, 0)
    assert pipe.due(99_999) == []
    soon = pipe.due(125_000)
    late = pipe.due(150_000)
    assert len(soon) / len(late) == pytest.approx(1.0, abs=0.15)
    assert len(soon + late) == pytest.approx(4000 * 0.7 * 1.2, rel=0.05)
    assert len(set(soon + late) & set(sent)) == pytest.approx(4000 * 0.7 * 0.9, rel=0.06)
    trouble.down = True
    pipe.put(b"never", 200_000)
    assert pipe.due(10**9) == []
