"""The watch on the rotors: which one is lost, how soon, and that nothing else is taken for it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from colibri.autopilot.control.rotor_loss.detector import ALARM, MAX_EVIDENCE, RotorWatch
from colibri.common.types import PerRotor
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import Physics, starting_world
from colibri.plant.vehicle.description import load_vehicle
from tests.support.plant_flights import rpm
from tests.support.states import state_of

HUMMINGBIRD = load_vehicle("hummingbird")
SAMPLE_US = 8000
WITHIN_SAMPLES = 6  # a twentieth of a second
WHOLE = Physics(HUMMINGBIRD, "rk4")
LEVEL = Start(z=50.0, rotors=4740.0)

commands = st.tuples(*[st.floats(0.55, 0.7)] * 4)
about_hover = st.tuples(*[st.floats(0.58, 0.65)] * 4)
"""Hover's command is 0.59. A rotor that is commanded less than that while the others are not is missed later."""
starts = st.builds(
    LEVEL._replace,
    **dict.fromkeys(("p", "q", "r"), st.floats(-10.0, 10.0)),
    **dict.fromkeys(("phi", "theta", "psi"), st.floats(-180.0, 180.0)),
)

touchdowns = st.builds(
    LEVEL._replace,
    z=st.just(0.25),
    vz=st.floats(-3.0, 0.0),
    **dict.fromkeys(("vx", "vy"), st.floats(-3.0, 3.0)),
    **dict.fromkeys(("phi", "theta"), st.floats(-35.0, 35.0)),
)


class Watched:
    def __init__(self, controls: PerRotor, start: Start = LEVEL) -> None:
        self.world = starting_world(start, HUMMINGBIRD)
        self.watch = RotorWatch(HUMMINGBIRD, SAMPLE_US * 1e-6)
        begin = start.rotors / rpm(HUMMINGBIRD, HUMMINGBIRD.rotors.max_speed)
        self.watch.begin((begin, begin, begin, begin))
        self._controls = controls
        self.see()

    def see(self) -> None:
        self.watch.step(state_of(self.world), self._controls, 0.0, airborne=True)

    def fly(self, physics: Physics, samples: int) -> int | None:
        for sample in range(samples):
            self.world = physics.step(self.world, ActuatorCommand(0, self._controls, armed=True), SAMPLE_US)
            self.see()
            if self.watch.lost is not None:
                return sample + 1
        return None


def lacking(rotor: int, part: float = 0.0) -> Physics:
    physics = Physics(HUMMINGBIRD, "rk4")
    physics.weaken_rotor(rotor, part)
    return physics


@pytest.mark.parametrize("rotor", range(4))
def test_a_lost_rotor_is_named_after_two_samples(rotor: int) -> None:
    flight = Watched((0.6, 0.6, 0.6, 0.6))
    assert flight.fly(WHOLE, 20) is None
    assert flight.fly(lacking(rotor), 20) == 2
    assert flight.watch.lost == rotor


@settings(max_examples=30)
@given(about_hover, starts, st.integers(0, 3))
def test_it_is_named_in_any_attitude_and_at_any_rate(controls: PerRotor, start: Start, rotor: int) -> None:
    flight = Watched(controls, start)
    assert flight.fly(WHOLE, 5) is None
    assert flight.fly(lacking(rotor), WITHIN_SAMPLES) is not None
    assert flight.watch.lost == rotor


@settings(max_examples=30)
@given(commands, starts, st.integers(0, 3), st.floats(0.6, 1.0))
def test_a_weak_rotor_is_none_that_is_lost(controls: PerRotor, start: Start, rotor: int, part: float) -> None:
    flight = Watched(controls, start)
    assert flight.fly(lacking(rotor, part), 25) is None
    assert flight.watch.max_evidence < 0.5 * ALARM


@settings(max_examples=30)
@given(st.tuples(*[st.floats(-20.0, 20.0)] * 6), st.integers(1, 5))
def test_one_jump_is_no_rotor(jump: tuple[float, ...], after: int) -> None:
    flight = Watched((0.6, 0.6, 0.6, 0.6))
    assert flight.fly(WHOLE, after) is None
    state = np.array(flight.world.state)
    state[:6] += jump
    flight.world = flight.world._replace(state=tuple(state.tolist()))
    assert flight.fly(WHOLE, 20) is None
    assert flight.watch.max_evidence <= MAX_EVIDENCE


@pytest.mark.parametrize("noise_rad_s", [0.05, 0.3, 2.0])
def test_a_noisy_gyroscope_is_no_rotor(noise_rad_s: float) -> None:
    """For eight seconds in which the vehicle rests, so to speak, in the air: all that is measured is the noise."""
    random = np.random.default_rng(7)
    hover = HUMMINGBIRD.hover_speed / HUMMINGBIRD.rotors.max_speed
    watch = RotorWatch(HUMMINGBIRD, SAMPLE_US * 1e-6)
    watch.begin((hover, hover, hover, hover))
    still = state_of(starting_world(LEVEL, HUMMINGBIRD))
    for _ in range(1000):
        p, q, r = (noise_rad_s * random.standard_normal(3)).tolist()
        watch.step(still._replace(rate_flu_rad_s=(p, q, r)), (hover, hover, hover, hover), 0.0, airborne=True)
    assert watch.lost is None


@settings(max_examples=30)
@given(touchdowns, st.floats(0.4, 0.65))
def test_ground_contact_is_no_lost_rotor(start: Start, speed: float) -> None:
    """The height is estimated too high, so the detection goes on after the touchdown."""
    flight = Watched((speed, speed, speed, speed), start)
    assert flight.fly(WHOLE, 40) is None
    assert flight.watch.max_evidence < 0.5 * ALARM


def test_on_the_ground_nothing_is_lost() -> None:
    flight = Watched((0.6, 0.6, 0.6, 0.6))
    for _ in range(10):
        flight.world = lacking(0).step(flight.world, ActuatorCommand(0, (0.6,) * 4, armed=True), SAMPLE_US)
        flight.watch.step(state_of(flight.world), (0.6, 0.6, 0.6, 0.6), 0.0, airborne=False)
    assert flight.watch.lost is None
    assert flight.watch.max_evidence == 0.0
