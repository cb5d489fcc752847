"""The rigid body: invariants that no shape test sees."""

from typing import TypeAlias

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mavlink.frames import Quaternion, Vector, earth_from_body
from mavlink.hil import ActuatorCommand
from plant.dynamics import Wrench, attitude_of, rigid_body
from plant.integrate import dormand_prince
from plant.vehicle import Vehicle, load_vehicle
from plant.world import Physics, world_at_rest
from tests.strategies import quaternions, reals, vectors

INERTIA = (0.0034, 0.0041, 0.006)
Array: TypeAlias = NDArray[np.float64]

MASS_KG = 0.698
GRAVITY_M_S2 = 9.81
SYMMETRIC_AND_NOT = st.sampled_from([INERTIA, (0.0034, 0.0034, 0.006)])
NO_MOMENT = (0.0, 0.0, 0.0)


def angular_momentum(q: Quaternion, rate: Vector, rotor_momentum: float, inertia: Vector) -> Array:
    """Angular momentum of body and rotors about the centre of mass, earth frame, N m s."""
    p, q_rate, r = rate
    body = (inertia[0] * p, inertia[1] * q_rate, inertia[2] * r + rotor_momentum)
    return np.array(earth_from_body(q, body))


def rotational_energy(rate: Vector, inertia: Vector) -> float:
    return 0.5 * sum(moment * speed * speed for moment, speed in zip(inertia, rate, strict=True))


def rate_of(state: list[float]) -> Vector:
    p, q, r = state[3:6]
    return (p, q, r)


@settings(max_examples=25)
@given(quaternions(), vectors(6.0), reals(0.02), SYMMETRIC_AND_NOT)
def test_torque_free_motion_conserves_energy_and_momentum(
    attitude: Quaternion, rate: Vector, rotor_momentum: float, inertia: Vector
) -> None:
    wrench = Wrench(0.0, NO_MOMENT, rotor_momentum)
    f = rigid_body(wrench, mass_kg=MASS_KG, gravity_m_s2=GRAVITY_M_S2, inertia_kg_m2=inertia)
    state = [0.0, 0.0, 0.0, *rate, 0.0, 0.0, 0.0, *attitude]
    end = dormand_prince()(f, state, 1.0)
    before = angular_momentum(attitude, rate, rotor_momentum, inertia)
    after = angular_momentum(attitude_of(end), rate_of(end), rotor_momentum, inertia)
    assert after == pytest.approx(before, abs=1e-9)
    assert rotational_energy(rate_of(end), inertia) == pytest.approx(rotational_energy(rate, inertia), abs=1e-8)


@given(vectors(20.0), reals(0.05), SYMMETRIC_AND_NOT)
def test_the_gyroscopic_moment_does_no_work(rate: Vector, rotor_momentum: float, inertia: Vector) -> None:
    def acceleration(h: float) -> Array:
        wrench = Wrench(0.0, NO_MOMENT, h)
        f = rigid_body(wrench, mass_kg=MASS_KG, gravity_m_s2=GRAVITY_M_S2, inertia_kg_m2=inertia)
        return np.array(f([0.0, 0.0, 0.0, *rate, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])[3:6])

    moment = np.array(inertia) * (acceleration(rotor_momentum) - acceleration(0.0))
    assert float(moment @ np.array(rate)) == pytest.approx(0.0, abs=1e-9)
    assert moment == pytest.approx(-np.cross(rate, (0.0, 0.0, rotor_momentum)), abs=1e-9)


@settings(max_examples=25)
@given(quaternions(), vectors(10.0), vectors(6.0))
def test_free_fall_is_a_parabola_however_it_tumbles(attitude: Quaternion, velocity: Vector, rate: Vector) -> None:
    wrench = Wrench(0.0, NO_MOMENT, 0.0)
    f = rigid_body(wrench, mass_kg=MASS_KG, gravity_m_s2=GRAVITY_M_S2, inertia_kg_m2=INERTIA)
    end = dormand_prince()(f, [*velocity, *rate, 1.0, 2.0, 3.0, *attitude], 1.0)
    start_velocity = np.array(earth_from_body(attitude, velocity))
    fallen = start_velocity + np.array([0.0, 0.0, -0.5 * GRAVITY_M_S2])
    assert np.array(end[6:9]) == pytest.approx(np.array([1.0, 2.0, 3.0]) + fallen, abs=1e-7)


@given(quaternions(), vectors(6.0))
def test_the_attitude_stays_a_unit_quaternion(attitude: Quaternion, rate: Vector) -> None:
    f = rigid_body(Wrench(0.0, NO_MOMENT, 0.0), mass_kg=1.0, gravity_m_s2=9.81, inertia_kg_m2=INERTIA)
    change = f([0.0, 0.0, 0.0, *rate, 0.0, 0.0, 0.0, *attitude])[9:]
    assert float(np.dot(attitude, change)) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("name", ["hummingbird", "hummingbird-thesis"])
def test_hover_stays_where_it_is(name: str) -> None:
    vehicle = load_vehicle(name)
    world = world_at_rest((1.0, 2.0, 3.0), 0.7, vehicle.hover_speed)
    end = Physics(vehicle, "rk4").step(world, hover(vehicle), 1_000_000)
    assert end.state == pytest.approx(world.state, abs=1e-9)
    assert end.time_us == 1_000_000


def test_a_disarmed_vehicle_falls() -> None:
    vehicle = load_vehicle("hummingbird")
    command = hover(vehicle)
    disarmed = ActuatorCommand(0, command.controls, armed=False)
    end = Physics(vehicle, "rk4").step(world_at_rest(NO_MOMENT, 0.0, vehicle.hover_speed), disarmed, 1_000_000)
    assert end.state[8] == pytest.approx(-0.5 * GRAVITY_M_S2, abs=1e-9)
    assert end.rotor_speeds == (0.0, 0.0, 0.0, 0.0)


def hover(vehicle: Vehicle) -> ActuatorCommand:
    share = vehicle.hover_speed / vehicle.rotors.max_speed
    return ActuatorCommand(0, (share, share, share, share), armed=True)
