"""Rotor lag, limits and idle."""

from itertools import pairwise
from math import exp

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from colibri.common.jit import packed
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.plant.environment.turbulence import CALM
from colibri.plant.physics.equations import close
from colibri.plant.physics.integrators import Integrator
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import Physics, parameters_of, starting_world
from colibri.plant.vehicle.description import Vehicle, load_vehicle
from tests.support.plant_flights import OFF, command, flight, hummingbird, rpm, speeds

LAGGING = hummingbird("rotor-lag")
CONTROLS = st.tuples(*[st.floats(0.0, 1.0)] * 4)


@pytest.mark.parametrize("integrator", ["rk4", "adaptive"])
@pytest.mark.parametrize(("begin", "end", "time_constant_s"), [(300.0, 700.0, 0.0125), (700.0, 300.0, 0.025)])
def test_a_step_is_followed_as_a_first_order_lag(
    begin: float, end: float, time_constant_s: float, integrator: Integrator
) -> None:
    start = Start(z=50.0, rotors=rpm(LAGGING, begin))
    worlds = flight(LAGGING, start, command(end, vehicle=LAGGING), 0.1, integrator=integrator)
    wanted = [end + (begin - end) * exp(-world.time_us * 1e-6 / time_constant_s) for world in worlds]
    assert speeds(worlds) == pytest.approx(np.array([wanted] * 4).T, rel=1e-6)


@pytest.mark.parametrize(("vehicle", "after_s"), [(LAGGING, 0.8), (hummingbird(), 0.004)], ids=["lag", "no lag"])
def test_each_rotor_follows_its_own_command(vehicle: Vehicle, after_s: float) -> None:
    wanted = (200.0, 400.0, 600.0, 800.0)
    end = flight(vehicle, Start(z=50.0, rotors=rpm(vehicle, 500.0)), command(*wanted, vehicle=vehicle), after_s)[-1]
    assert end.rotor_speeds == pytest.approx(wanted, rel=1e-9)


def test_disarmed_rotors_coast_down_and_armed_ones_idle() -> None:
    start = Start(z=50.0, rotors=rpm(LAGGING, 500.0))
    coasting = speeds(flight(LAGGING, start, OFF, 0.1))[:, 0]
    assert coasting[-1] == pytest.approx(500.0 * exp(-4.0), rel=1e-6)
    armed = ActuatorCommand(0, (0.0, 0.0, 0.0, 0.0), armed=True)
    idling = speeds(flight(LAGGING, start, armed, 0.5))
    assert idling[-1] == pytest.approx([LAGGING.rotors.idle_speed] * 4)
    assert (idling >= LAGGING.rotors.idle_speed).all()


@settings(max_examples=25)
@given(st.lists(st.tuples(CONTROLS, st.booleans()), min_size=2, max_size=20), st.floats(0.0, 8000.0))
@pytest.mark.parametrize("name", ["hummingbird", "hummingbird-thesis"])
def test_no_rotor_leaves_its_limits(
    name: str, orders: list[tuple[tuple[float, float, float, float], bool]], start_rpm: float
) -> None:
    vehicle = load_vehicle(name)
    physics, worlds = Physics(vehicle, "rk4"), [starting_world(Start(z=50.0, rotors=start_rpm), vehicle)]
    for controls, armed in orders:
        worlds.append(physics.step(worlds[-1], ActuatorCommand(0, controls, armed), 4000))
    turned = speeds(worlds)
    assert (turned >= 0.0).all()
    assert (turned <= vehicle.rotors.max_speed).all()
    for (before, after), (_, armed) in zip(pairwise(turned), orders, strict=True):
        assert not armed or (after >= np.minimum(before, vehicle.rotors.idle_speed)).all()


def test_rounding_cannot_carry_a_rotor_past_its_limits() -> None:
    x = np.array([*(0.0,) * 9, 1.0, *(0.0,) * 3, -1e-9, 838.0 + 1e-9, 500.0, 838.0, 0.0])
    close(x, packed(parameters_of(LAGGING, CALM)))
    assert x[13:17].tolist() == [0.0, 838.0, 500.0, 838.0]
