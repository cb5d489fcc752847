"""The rigid body: invariants that no shape test sees."""

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from colibri.common.jit import Packed, packed
from colibri.common.rotations import earth_from_body
from colibri.common.types import Array, Quaternion, Vector
from colibri.plant.environment.turbulence import CALM
from colibri.plant.physics.equations import attitude_of
from colibri.plant.physics.integrators import adaptive_step
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import parameters_of
from colibri.plant.vehicle.description import load_vehicle
from tests.support.plant_flights import flight, hover, hummingbird, rpm
from tests.support.states import derivative
from tests.support.strategies import quaternions, vectors

INERTIA = (0.0034, 0.0041, 0.006)
GRAVITY_M_S2 = 9.81
MOMENTUM_PER_SPEED = 1.302e-6
SYMMETRIC_AND_NOT = st.sampled_from([INERTIA, (0.0034, 0.0034, 0.006)])
STILL = (0.0, 0.0, 0.0, 0.0)
SPEEDS = st.tuples(*[st.floats(0.0, 838.0)] * 4)
Speeds = tuple[float, float, float, float]


def free(inertia: Vector, *parts: str) -> Packed:
    parameters = parameters_of(hummingbird(*parts), CALM)
    return packed(parameters._replace(thrust=STILL, yaw_moment=STILL, inertia_kg_m2=inertia))


def x_of(velocity: Vector, rate: Vector, position: Vector, attitude: Quaternion, speeds: Speeds) -> Array:
    return np.array([*velocity, *rate, *position, *attitude, *speeds, 0.0])


class Spin(NamedTuple):
    momentum: Array
    energy_j: float


def spin(x: Array, inertia: Vector) -> Spin:
    """Angular momentum of body and rotors about the centre of mass, earth frame, and energy of the body's rotation."""
    p, q, r = rate = x[3:6]
    rotors = MOMENTUM_PER_SPEED * (x[13] - x[14] + x[15] - x[16])
    body = (inertia[0] * p, inertia[1] * q, inertia[2] * r + rotors)
    return Spin(np.array(earth_from_body(attitude_of(x.tolist()), body)), 0.5 * float(np.array(inertia) @ rate**2))


@settings(max_examples=25)
@given(quaternions(), vectors(6.0), SPEEDS, SYMMETRIC_AND_NOT)
def test_torque_free_motion_conserves_energy_and_momentum(
    attitude: Quaternion, rate: Vector, speeds: Speeds, inertia: Vector
) -> None:
    x = x_of(CALM, rate, CALM, attitude, speeds)
    adaptive_step(x, speeds, free(inertia), 1.0, end := np.empty_like(x))
    before, after = spin(x, inertia), spin(end, inertia)
    assert after.momentum == pytest.approx(before.momentum, abs=1e-9)
    assert after.energy_j == pytest.approx(before.energy_j, abs=1e-8)


@settings(max_examples=25)
@given(quaternions(), vectors(6.0), SPEEDS, SPEEDS)
def test_rotor_acceleration_turns_the_body_the_other_way(
    attitude: Quaternion, rate: Vector, speeds: Speeds, target: Speeds
) -> None:
    x = x_of(CALM, rate, CALM, attitude, speeds)
    adaptive_step(x, target, free(INERTIA, "rotor-lag"), 0.2, end := np.empty_like(x))
    assert end[13:17] == pytest.approx(target, abs=0.3)
    assert spin(end, INERTIA).momentum == pytest.approx(spin(x, INERTIA).momentum, abs=1e-9)


@settings(max_examples=25)
@given(quaternions(), vectors(10.0), vectors(6.0))
def test_free_fall_is_a_parabola_however_it_tumbles(attitude: Quaternion, velocity: Vector, rate: Vector) -> None:
    x = x_of(velocity, rate, (1.0, 2.0, 3.0), attitude, STILL)
    adaptive_step(x, STILL, free(INERTIA), 1.0, end := np.empty_like(x))
    start_velocity = np.array(earth_from_body(attitude, velocity))
    fallen = start_velocity + np.array([0.0, 0.0, -0.5 * GRAVITY_M_S2])
    assert end[6:9] == pytest.approx(np.array([1.0, 2.0, 3.0]) + fallen, abs=1e-7)


@given(quaternions(), vectors(6.0))
def test_the_attitude_stays_a_unit_quaternion(attitude: Quaternion, rate: Vector) -> None:
    change = derivative(x_of(CALM, rate, CALM, attitude, STILL), STILL, free(INERTIA))[9:13]
    assert float(np.dot(attitude, change)) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("name", ["hummingbird", "hummingbird-thesis"])
def test_hover_stays_where_it_is(name: str) -> None:
    vehicle = load_vehicle(name).without({"battery"})
    start = Start(x=1.0, y=2.0, z=3.0, psi=40.0, rotors=rpm(vehicle, vehicle.hover_speed))
    first, *_, last = flight(vehicle, start, hover(vehicle), 1.0)
    assert last.state == pytest.approx(first.state, abs=1e-9)
    assert last.time_us == 1_000_000
