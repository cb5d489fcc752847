"""The short version of the fuzzing campaign: `make fuzz` has the long one."""

import random
from pathlib import Path

import pytest

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.core.track_stages import track_autopilot
from colibri.autopilot.guidance.trajectories.registry import track
from colibri.flights.flight import InMemory, SteppedFlight
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.state import StateFrame
from colibri.plant.physics.start import default_starts
from colibri.plant.physics.world import State
from colibri.plant.simulation.plant import PlantBuilder
from colibri.plant.spec import WorldSpec
from colibri.plant.vehicle.description import load_vehicle
from tools.fuzz.campaign import campaign
from tools.fuzz.datagrams import AUTOPILOT, FRAME_US, PLANT, Fuzzer
from tools.fuzz.vehicle import MAX_GROWTH_MIB, growth_mib

FRAMES = 50
PROFILE = load_profile("thesis")
VEHICLE = load_vehicle(PROFILE.simulation.vehicle)


class HostileWire(InMemory):
    """A wire with `burst` hostile datagrams before and after each good one."""

    def __init__(self, burst: int = 0, fuzzers: tuple[Fuzzer, Fuzzer] | None = None) -> None:
        self._burst, self._fuzzers, self._now_us = burst, fuzzers, 0
        super().__init__(FRAME_US, Feedback.STATE, traffic=lambda *_: None)  # every frame is a datagram then

    def carried_up(self, datagrams: list[bytes]) -> list[bytes]:
        return self._among(datagrams, 1)

    def carried_down(self, datagrams: list[bytes]) -> list[bytes]:
        return self._among(datagrams, 0)

    def at(self, now_us: int) -> None:
        self._now_us = now_us

    def _among(self, datagrams: list[bytes], which: int) -> list[bytes]:
        if not (self._fuzzers and self._now_us):
            return datagrams
        fuzzer = self._fuzzers[which]
        fuzzer.moment_us = self._now_us
        before, after = ([fuzzer.hostile() for _ in range(self._burst)] for _ in range(2))
        return [*before, *datagrams, *after]


def fly(wire: HostileWire) -> list[State]:
    """Fly the thesis's spiral in this process."""
    autopilot = track_autopilot(PROFILE, VEHICLE, track("spiral"), lambda: 0.0)
    builder = PlantBuilder(WorldSpec(), VEHICLE, default_starts(VEHICLE))
    flight = SteppedFlight(builder.build(Feedback.STATE, FRAME_US), autopilot, wire)
    states = []
    for _ in range(FRAMES):
        wire.at(flight.time_us)
        states.append(flight.step().world.state)
    return states


@pytest.fixture(scope="module")
def undisturbed() -> list[State]:
    return fly(HostileWire())


@pytest.mark.parametrize("seed", range(4))
def test_a_flight_under_fire_is_the_same_flight(seed: int, undisturbed: list[State]) -> None:
    """Hostile datagrams from the peer's own address, before and after each good one, change no bit of any state."""
    chance = random.Random(seed)
    wire = HostileWire(20, (Fuzzer(chance, AUTOPILOT, PLANT), Fuzzer(chance, PLANT, AUTOPILOT)))
    states = fly(wire)
    assert states == undisturbed
    assert wire.plant_end.frame_interval_us == FRAME_US
    plant, autopilot = wire.plant_end.dropped, wire.autopilot_end.dropped
    assert min(plant[reason] for reason in ("foreign", "invalid", "repeated", "unexpected", "unknown")) > 10
    assert min(autopilot[reason] for reason in ("foreign", "invalid", "out of step", "unexpected", "unknown")) > 10


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("seed", range(4))
def test_the_control_law_answers_whatever_decodes(seed: int) -> None:
    """Frames of a plant gone mad, finite and with a unit quaternion, get a command that rotors can follow.

    At a pitch of 90 degrees numpy may warn that the model overflows: the QP then has no solution, and the moments stay.
    """
    chance = random.Random(seed)
    autopilot = track_autopilot(PROFILE, VEHICLE, track("spiral"), lambda: 0.0)
    for sample in range(100):
        scale = 10.0 ** chance.uniform(-38.0, 38.0)
        x, y, z, u, v, w, p, q, r = (chance.choice((0.0, scale, -scale, 3.4e38)) for _ in range(9))
        attitude = chance.choice(((1.0, 0.0, 0.0, 0.0), (0.5**0.5, 0.0, 0.5**0.5, 0.0), (0.0, 0.6, 0.8, 0.0)))
        step = autopilot.step(StateFrame(sample * FRAME_US, (x, y, z), (u, v, w), attitude, (p, q, r)))
        assert all(0.0 <= control <= 1.0 for control in step.command.controls)


@pytest.mark.long
def test_two_processes_under_fire(tmp_path: Path) -> None:
    outcome = campaign(tmp_path, 2500, burst=50, seed=1)
    assert outcome.failures == []
    assert set(outcome.sent.values()) == {2500}


def test_a_leak_is_told_from_a_step_of_the_allocator() -> None:
    chance = random.Random(1)
    noise = [chance.uniform(-0.5, 0.5) for _ in range(60)]
    for late in (5, 30, 55):
        assert abs(growth_mib([200.0 + 18.0 * (i > late) + each for i, each in enumerate(noise)])) < 2.0
    assert growth_mib([200.0 + 0.1 * i + each for i, each in enumerate(noise)]) > MAX_GROWTH_MIB
    assert growth_mib([200.0 + 2.0 * (i // 15) + each for i, each in enumerate(noise)]) > MAX_GROWTH_MIB
    assert growth_mib([200.0]) == 0.0
