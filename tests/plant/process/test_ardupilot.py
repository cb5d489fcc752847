"""ArduPilot's JSON interface: the conversation, the order of the rotors, and a flight through it."""

from collections.abc import Iterator
from contextlib import closing
from math import atan2, radians
from pathlib import Path
from time import perf_counter

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.mavlink.links.open import open_link
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import Physics, starting_world
from colibri.plant.process.ardupilot_server import ArduPilotEnd
from colibri.plant.vehicle.description import Rotors, VehicleError, load_vehicle
from tests.support.ardupilot import pulses, read, request
from tests.support.recorded import begins_as_recorded
from tools.harness.processes import GIVE_UP_AFTER_S, Process, running, topic_rows

VEHICLE = load_vehicle("hummingbird")
PHYSICS = Physics(VEHICLE, "rk4")
MOTORS = VEHICLE.rotors.numbering()
SENDER, OTHER = ("127.0.0.1", 50000), ("127.0.0.1", 50001)
NORTH = Start(psi=90.0)
TARGET_NED_M = (2.0, 1.0, -3.0)


def standing(start: Start = NORTH) -> ArduPilotEnd:
    return ArduPilotEnd(PHYSICS, starting_world(start, VEHICLE), MOTORS, VEHICLE.rotors)


def answered(end: ArduPilotEnd, datagram: bytes, now_s: float = 0.0) -> bytes:
    reply = end.receive(datagram, SENDER, now_s)
    assert reply is not None
    return reply


def turned(bearings_deg: tuple[float, ...], directions: str) -> Rotors:
    """Return the Hummingbird's rotors elsewhere: degrees clockwise from the front; `c` turns clockwise."""
    places = tuple((0.17 * float(np.cos(radians(b))), -0.17 * float(np.sin(radians(b)))) for b in bearings_deg)
    turns = tuple("cw" if letter == "c" else "ccw" for letter in directions)
    return msgspec.structs.replace(VEHICLE.rotors, position_m=places, direction=turns)


def test_a_foreign_autopilot_takes_off_and_holds_a_point() -> None:
    end = standing()
    told = read(answered(end, request(0)))
    for count in range(1, 400 * 15):
        told = read(answered(end, request(count, pulses(told, TARGET_NED_M))))
    assert told["position"] == pytest.approx(TARGET_NED_M, abs=0.02)
    assert np.linalg.norm(told["velocity"]) < 0.01
    w, _, _, z = told["quaternion"]
    assert 2.0 * atan2(z, w) == pytest.approx(0.0, abs=0.02)
    assert told["imu"]["accel_body"] == pytest.approx([0.0, 0.0, -9.81], abs=0.05)
    assert end.world.state[6:9] == pytest.approx((1.0, 2.0, 3.0), abs=0.02)


@pytest.mark.parametrize("rate_hz", [400, 1200, 777])
def test_time_keeps_step_with_the_frame_rate(rate_hz: int) -> None:
    end = standing()
    times = [read(answered(end, request(count, rate_hz=rate_hz)))["timestamp"] for count in range(2 * rate_hz)]
    assert times[rate_hz - 1] == 1.0
    assert times[-1] == 2.0
    assert np.diff(times) == pytest.approx(1.0 / rate_hz, abs=1.1e-6)


def test_a_repeated_request_is_answered_from_memory() -> None:
    end = standing()
    first = answered(end, request(0, (1500,) * 4))
    world = end.world
    assert answered(end, request(0, (1900,) * 4)) == first
    assert end.world is world
    assert end.dropped == {"repeated": 1}
    assert read(answered(end, request(1)))["timestamp"] == 2 / 400


def test_a_restarted_ardupilot_finds_the_vehicle_at_its_start() -> None:
    end = standing()
    first = answered(end, request(0))
    for count in range(1, 200):
        answered(end, request(count, (1700,) * 4))
    assert end.world.state[8] > 0.1
    assert answered(end, request(0)) == first
    assert end.restarts == 1


def test_a_restarted_plant_continues_at_the_time_requested() -> None:
    end = standing()
    assert read(answered(end, request(123456)))["timestamp"] == 1 / 400
    assert read(answered(end, request(123457)))["timestamp"] == 2 / 400
    assert end.restarts == 0


def test_thirty_two_channels() -> None:
    both = [answered(standing(), request(7, (1600,) * 4, channels=channels)) for channels in (16, 32)]
    assert both[0] == both[1]


def test_a_second_ardupilot_waits_until_the_first_is_gone() -> None:
    end = standing()
    answered(end, request(5), now_s=1.0)
    assert end.receive(request(0), OTHER, 1.4) is None
    assert end.dropped == {"second autopilot": 1}
    assert end.world.time_us == 2500
    assert end.receive(request(0), OTHER, 1.6) is not None
    assert end.peer == OTHER


@given(st.one_of(st.binary(max_size=100), st.binary(min_size=40, max_size=40), st.binary(min_size=72, max_size=72)))
def test_what_is_no_request_is_dropped(datagram: bytes) -> None:
    end = standing()
    reply = end.receive(datagram, SENDER, 0.0)
    assert (reply is None) == (end.dropped.total() == 1)
    assert reply is not None or (end.peer is None and end.world.time_us == 0)


def test_a_frame_rate_that_no_simulation_needs_is_refused() -> None:
    end = standing()
    assert end.receive(request(0, rate_hz=0), SENDER, 0.0) is None
    assert end.receive(request(0, rate_hz=9), SENDER, 0.0) is None
    assert end.dropped == {"frame rate": 2}


def test_disarmed_the_rotors_stand() -> None:
    end = standing()
    for count, pulse in enumerate((1000, 0, 900)):
        answered(end, request(count, (pulse,) * 4))
        assert end.world.rotor_speeds == (0.0,) * 4
    answered(end, request(3, (1100, 1000, 1000, 1000)))
    assert min(end.world.rotor_speeds) > 0.0


@pytest.mark.parametrize(
    ("bearings_deg", "directions", "shape", "rotors", "frame_type"),
    [
        ((90.0, -90.0, 0.0, 180.0), "ttcc", "+", (0, 1, 2, 3), 0),
        ((0.0, 90.0, 180.0, 270.0), "tctc", "+", (1, 3, 0, 2), 6),
        ((0.0, 90.0, 180.0, 270.0), "ctct", "+", (1, 3, 0, 2), 0),
        ((45.0, -135.0, -45.0, 135.0), "ttcc", "x", (0, 1, 2, 3), 1),
        ((45.0, -135.0, -45.0, 135.0), "cctt", "x", (0, 1, 2, 3), 3),
        ((-50.0, 50.0, 130.0, 230.0), "ctct", "x", (1, 3, 0, 2), 1),
    ],
)
def test_rotors_are_numbered_by_where_they_are(
    bearings_deg: tuple[float, ...], directions: str, shape: str, rotors: tuple[int, ...], frame_type: int
) -> None:
    found = turned(bearings_deg, directions).numbering()
    assert (found.shape, found.rotors, found.ardupilot_frame) == (shape, rotors, (1, frame_type))


def test_rotors_that_nobody_else_numbers_are_refused() -> None:
    with pytest.raises(VehicleError, match="not those of a frame"):
        turned((22.5, 112.5, 202.5, 292.5), "tctc").numbering()


@pytest.fixture
def plant(tmp_path: Path) -> Iterator[Process]:
    process = Process(
        tmp_path, "plant", "--serve", "ardupilot-json", "--link", "udpin:127.0.0.1:0", "--out", str(tmp_path / "out")
    )
    with running(process):
        yield process


@begins_as_recorded
def test_the_process_answers_and_keeps_its_log(plant: Process, tmp_path: Path) -> None:
    with closing(open_link(plant.wait_for("listening")["url"].replace("udpin", "udpout"))) as link:
        frame = plant.wait_for("frame")
        assert (frame["frame_type"], frame["thrust_expo"]) == (6, pytest.approx(0.739, abs=1e-3))
        assert frame["text"].endswith("; all parameters: colibri vehicle hummingbird --for ardupilot")
        end, told, answer = standing(), None, b""
        for count in range(300):
            sent = request(count, pulses(told, TARGET_NED_M) if told else (1000,) * 4)
            for _ in range(3 if count == 0 else 1):  # it asks again while the plant is still loading
                link.send(sent)
            received, before, answer = link.receive(GIVE_UP_AFTER_S), answer, answered(end, sent)
            while received is not None and received[0] == before:
                received = link.receive(GIVE_UP_AFTER_S)
            assert received is not None
            assert received[0] == answer
            told = read(received[0])
    plant.process.terminate()
    assert plant.wait() == 143
    ended = plant.events("ended")[0]
    assert ended["steps"] == 300
    times_s = topic_rows(tmp_path / "out")["t"]
    assert (len(times_s), times_s[-1]) == (300, 0.75)


def test_another_ardupilot_is_served_once_the_first_is_gone(plant: Process) -> None:
    """Each has its own port; until the first is gone, Linux drops the packets of others."""
    url = plant.wait_for("listening")["url"].replace("udpin", "udpout")
    for _ in range(2):
        with closing(open_link(url)) as link:
            for count in range(3):
                told = {"timestamp": -1.0}
                give_up_s = perf_counter() + GIVE_UP_AFTER_S
                while told["timestamp"] != (count + 1) / 400:
                    assert perf_counter() < give_up_s
                    link.send(request(count))  # ArduPilot asks again, too
                    received = link.receive(0.1)
                    told = read(received[0]) if received else told
    plant.process.terminate()
    assert plant.wait() == 143
    assert [event["steps"] for event in (*plant.events("gone"), *plant.events("ended"))] == [3, 3]


@pytest.mark.parametrize("whom", ["colibri", "ardupilot-json"])
def test_a_plant_that_is_to_call_whoever_calls_it_says_so(whom: str, tmp_path: Path) -> None:
    """It would wait for ever on a port that nobody knows."""
    process = Process(tmp_path, "plant", "--serve", whom, "--link", "udpout:127.0.0.1:9002")
    with running(process):
        assert process.wait() == 2
    assert (
        process.errors()
        .splitlines()[-1]
        .endswith("udpout:127.0.0.1:9002: the plant calls PX4 alone; others call it: give --link udpin:HOST:PORT")
    )
