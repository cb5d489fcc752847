"""The plain law and the last resort: they take over in any attitude and at speed."""

from collections.abc import Callable
from functools import partial
from math import hypot

import numpy as np
import pytest

from colibri.autopilot.control.interface import AttitudeDemand, Decision, VehicleState
from colibri.autopilot.core.actuation import controls_of
from colibri.autopilot.core.defence.plain_law import Descent, PlainLaw
from colibri.common.rotations import tilt_deg
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import World, state_frame
from colibri.plant.simulation.plant import PlantBuilder
from colibri.plant.spec import WorldSpec
from colibri.plant.vehicle.description import load_vehicle
from tests.support.states import state_of

INTERVAL_US = 8000
UP = np.array([0.0, 0.0, 1.0])


def flown(
    start: Start, samples: int, decide: Callable[[int, VehicleState], Decision | None], name: str = "hummingbird"
) -> World:
    """Fly for some samples, or until there is no decision."""
    vehicle = load_vehicle(name)
    plant = PlantBuilder(WorldSpec(), vehicle, {Feedback.STATE: start}).build(Feedback.STATE, INTERVAL_US)
    for _ in range(samples):
        time_us = plant.world.time_us
        decision = decide(time_us, state_of(plant.world))
        if decision is None:
            break
        plant.answer(ActuatorCommand(time_us, controls_of(decision, vehicle.rotors), armed=True), ())
    return plant.world


def law_of(name: str = "hummingbird") -> PlainLaw:
    return PlainLaw(load_vehicle(name), INTERVAL_US * 1e-6)


@pytest.mark.parametrize("vehicle", ["hummingbird", "iris"])
@pytest.mark.parametrize(
    "start",
    [
        Start(z=20.0, rotors=4740.0, vx=12.0, vy=-5.0),
        Start(z=20.0, rotors=4740.0, phi=178.0),
        Start(z=20.0, rotors=4740.0, theta=85.0, p=4.0, r=6.0),
    ],
    ids=["fast", "upside down", "spinning"],
)
def test_it_takes_over_brakes_and_stays(start: Start, vehicle: str) -> None:
    law = law_of(vehicle)
    frame = state_frame(flown(start, 1000, lambda _, state: law.by_velocity(state, np.zeros(3)), vehicle))
    assert tilt_deg(frame.attitude) < 3.0
    assert hypot(*frame.velocity_enu_m_s) < 0.2
    assert frame.position_enu_m[2] > 5.0


def test_it_turns_to_an_attitude_that_is_asked_for() -> None:
    law, vehicle = law_of(), load_vehicle("hummingbird")
    weight_n = vehicle.body.mass_kg * vehicle.gravity_m_s2
    demand = AttitudeDemand(np.array([[0.3, -0.2, 0.0]]), np.zeros((1, 3)), np.array([weight_n]))
    world = flown(Start(z=20.0, rotors=4740.0), 100, lambda _, state: law.step_attitude(state, demand))
    assert state_of(world).euler[:2] == pytest.approx((0.3, -0.2), abs=0.05)


def test_the_descent_ends_on_the_ground_and_not_before() -> None:
    descent, start = Descent(0, 0.0, standing=False), Start(z=6.0, rotors=4740.0, vx=8.0)
    world = flown(start, 1500, partial(descent.step, law_of()))
    assert descent.landed
    assert world.state[8] < 0.05
    assert tilt_deg(state_frame(world).attitude) < 3.0


def test_a_vehicle_that_stands_stays() -> None:
    assert flown(Start(), 1, partial(Descent(0, 0.0, standing=True).step, law_of())).time_us == 0
