"""The plain law and the last resort: they take over in any attitude and at speed."""

from math import hypot

import numpy as np
import pytest

from colibri.autopilot.control.interface import AttitudeDemand, VehicleState
from colibri.autopilot.core.actuation import controls_of
from colibri.autopilot.core.defence.descent import Descent
from colibri.autopilot.core.defence.plain_law import PlainLaw
from colibri.common.rotations import euler_from_quaternion, tilt_deg
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.state import ActuatorCommand, StateFrame
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import state_frame
from colibri.plant.simulation.plant import Plant, PlantBuilder
from colibri.plant.spec import WorldSpec
from colibri.plant.vehicle.description import load_vehicle

INTERVAL_US = 8000
UP = np.array([0.0, 0.0, 1.0])


def state_of(frame: StateFrame) -> VehicleState:
    euler = euler_from_quaternion(frame.attitude)
    return VehicleState(frame.position_enu_m, frame.velocity_enu_m_s, frame.attitude, euler, frame.rate_flu_rad_s)


def plant_at(start: Start, vehicle: str = "hummingbird") -> Plant:
    builder = PlantBuilder(WorldSpec(), load_vehicle(vehicle), {Feedback.STATE: start})
    return builder.build(Feedback.STATE, INTERVAL_US)


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
    plant = plant_at(start, vehicle)
    described = load_vehicle(vehicle)
    law = PlainLaw(described, INTERVAL_US * 1e-6)
    for _ in range(1000):
        frame, _ = plant.measure()
        assert isinstance(frame, StateFrame)
        decision = law.by_velocity(state_of(frame), np.zeros(3))
        plant.answer(ActuatorCommand(frame.time_us, controls_of(decision, described.rotors.max_speed), armed=True), ())
    frame = state_frame(plant.world)
    assert tilt_deg(frame.attitude) < 3.0
    assert hypot(*frame.velocity_enu_m_s) < 0.2
    assert frame.position_enu_m[2] > 5.0


def test_it_turns_to_an_attitude_that_is_asked_for() -> None:
    described = load_vehicle("hummingbird")
    plant, law = plant_at(Start(z=20.0, rotors=4740.0)), PlainLaw(described, INTERVAL_US * 1e-6)
    weight_n = described.body.mass_kg * described.gravity_m_s2
    demand = AttitudeDemand(np.array([[0.3, -0.2, 0.0]]), np.zeros((1, 3)), np.array([weight_n]))
    for _ in range(100):
        frame, _ = plant.measure()
        assert isinstance(frame, StateFrame)
        decision = law.step_attitude(state_of(frame), demand)
        plant.answer(ActuatorCommand(frame.time_us, controls_of(decision, described.rotors.max_speed), armed=True), ())
    phi, theta, _ = euler_from_quaternion(state_frame(plant.world).attitude)
    assert (phi, theta) == pytest.approx((0.3, -0.2), abs=0.05)


def test_the_descent_ends_on_the_ground_and_not_before() -> None:
    described = load_vehicle("hummingbird")
    plant, law = plant_at(Start(z=6.0, rotors=4740.0, vx=8.0)), PlainLaw(described, INTERVAL_US * 1e-6)
    descent = Descent(0, 0.0, standing=False)
    for _ in range(1500):
        frame, _ = plant.measure()
        assert isinstance(frame, StateFrame)
        decision = descent.step(law, frame.time_us, state_of(frame))
        if decision is None:
            break
        plant.answer(ActuatorCommand(frame.time_us, controls_of(decision, described.rotors.max_speed), armed=True), ())
    assert descent.landed
    assert plant.world.state[8] < 0.05
    assert tilt_deg(state_frame(plant.world).attitude) < 3.0


def test_a_vehicle_that_stands_stays() -> None:
    descent = Descent(0, 0.0, standing=True)
    frame, _ = plant_at(Start()).measure()
    assert isinstance(frame, StateFrame)
    assert descent.step(PlainLaw(load_vehicle("hummingbird"), 8e-3), 0, state_of(frame)) is None
