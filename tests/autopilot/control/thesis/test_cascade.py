"""The position loop of the cascade, and the mixer."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.autopilot.control.interface import AT_REST as STATE
from colibri.autopilot.control.thesis.cascade import demanded
from colibri.autopilot.control.vehicle_model.mixer import Mixer
from colibri.common.jit import packed
from colibri.common.rotations import earth_from_body, quaternion_from_euler
from colibri.common.types import Vector
from colibri.plant.physics.equations import rotor_momentum, rotor_wrench
from colibri.plant.physics.world import parameters_of
from colibri.plant.vehicle.description import load_vehicle
from tests.support.strategies import reals, vectors

VEHICLE = load_vehicle("hummingbird")
WEIGHT_N = VEHICLE.body.mass_kg * VEHICLE.gravity_m_s2
AT_REST = (0.0, 0.0, 0.0)


@given(vectors(3.0), vectors(3.0), reals(10.0))
def test_the_thrust_gives_the_acceleration_of_the_poles(error: Vector, speed: Vector, yaw: float) -> None:
    """Feedback linearisation: on the nonlinear body the closed loop is e'' = -k1 e - k2 e' on every axis."""
    demand = demanded((-1.0, -1.5), VEHICLE, STATE._replace(velocity_enu_m_s=speed), error, AT_REST, yaw)
    attitude = quaternion_from_euler(demand.phi, demand.theta, yaw)
    force_n = np.array(earth_from_body(attitude, (0.0, 0.0, demand.thrust_n))) - [0.0, 0.0, WEIGHT_N]
    wanted = 1.5 * np.array(error) - 2.5 * np.array(speed)
    if wanted[2] > -0.9 * VEHICLE.gravity_m_s2:
        assert force_n / VEHICLE.body.mass_kg == pytest.approx(wanted, abs=1e-9)


SPEED = st.floats(0.0, VEHICLE.rotors.max_speed)


@pytest.mark.parametrize("name", ["hummingbird", "hummingbird-thesis"])
@given(st.tuples(*[st.floats(0.0, 1.0)] * 4))
def test_the_mixer_undoes_the_rotors(name: str, controls: tuple[float, float, float, float]) -> None:
    vehicle = load_vehicle(name)
    c1, c2, c3, c4 = (control * vehicle.rotors.max_speed for control in controls)
    speeds = (c1, c2, c3, c4)
    wrench = rotor_wrench(speeds, packed(parameters_of(vehicle, AT_REST))[0])
    mixed = Mixer(vehicle).rotor_speeds(np.array([wrench.force_n[2], *wrench.moment_n_m]))
    assert mixed**2 == pytest.approx(np.array(speeds) ** 2, abs=1e-9 * vehicle.rotors.max_speed**2)


@given(st.tuples(*[reals(1e3)] * 4))
def test_the_mixer_stays_within_the_rotors_limits(wrench: tuple[float, ...]) -> None:
    speeds = Mixer(VEHICLE).rotor_speeds(np.array(wrench))
    assert (speeds >= 0.0).all()
    assert (speeds <= VEHICLE.rotors.max_speed).all()


@given(st.tuples(SPEED, SPEED, SPEED, SPEED))
def test_plant_and_autopilot_agree_on_the_rotors(speeds: tuple[float, float, float, float]) -> None:
    mixer, parameters = Mixer(VEHICLE), packed(parameters_of(VEHICLE, AT_REST))[0]
    wrench = rotor_wrench(speeds, parameters)
    assert mixer.wrench(np.array(speeds)) == pytest.approx([wrench.force_n[2], *wrench.moment_n_m], rel=1e-12)
    assert mixer.momentum(np.array(speeds)) == pytest.approx(rotor_momentum(speeds, parameters), abs=1e-12)
