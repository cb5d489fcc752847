"""The ground: rest, landing, friction, take-off, and a fall on the back."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.common.jit import packed
from colibri.common.rotations import rotation_matrix
from colibri.common.types import Quaternion, Vector
from colibri.plant.environment.turbulence import CALM
from colibri.plant.physics.equations import contact_wrench
from colibri.plant.physics.integrators import Integrator
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import parameters_of, starting_world
from colibri.plant.texts import wind
from colibri.plant.vehicle.description import VehicleError, load_vehicle
from tests.support.plant_flights import OFF, flight, hover, rpm, states
from tests.support.strategies import quaternions, vectors

VEHICLE = load_vehicle("hummingbird")
TOUCHED_M = 1e-4


@pytest.mark.parametrize("integrator", ["rk4", pytest.param("adaptive", marks=pytest.mark.long)])
def test_it_rests_where_it_stands(integrator: Integrator) -> None:
    rest = states(flight(VEHICLE, Start(x=1.0, psi=30.0), OFF, 5.0, integrator=integrator))
    assert rest[-1] == pytest.approx(rest[0], abs=1e-9)


def test_a_breeze_hardly_moves_it() -> None:
    rest = states(flight(VEHICLE, Start(), OFF, 10.0, wind=wind("5@270").velocity_at(0.0)))
    assert 0.0 < (rest[-1, 6] - rest[0, 6]) / 10.0 < 0.5e-3
    assert np.abs(rest[:, 8]).max() < 1e-4
    assert np.abs(rest[:, 10:13]).max() < 1e-3


@pytest.mark.parametrize("speed_m_s", [0.3, 1.0, 1.5, 2.0])
@pytest.mark.parametrize("integrator", ["rk4", "adaptive"])
def test_a_landing_neither_bounces_nor_sinks(speed_m_s: float, integrator: Integrator) -> None:
    start = Start(z=0.02, vz=-speed_m_s, rotors=rpm(VEHICLE, 300.0))
    height_m = states(flight(VEHICLE, start, OFF, 1.0, integrator=integrator, frame_us=1000))[:, 8]
    first = int(np.argmax(height_m < TOUCHED_M))
    assert height_m.min() > -0.003
    assert height_m[first:].max() < 0.5e-3
    assert height_m[-1] == pytest.approx(0.0, abs=1e-4)


def test_friction_stops_a_slide_as_coulomb_says() -> None:
    end = states(flight(VEHICLE.without({"drag"}), Start(vx=1.0), OFF, 2.0))[-1]
    assert end[6] == pytest.approx(1.0 / (2.0 * 0.6 * 9.81), rel=0.05)


@pytest.mark.parametrize(("share", "flies"), [(0.5, False), (0.98, False), (1.02, True)])
def test_it_takes_off_above_its_weight(share: float, flies: bool) -> None:
    height_m = states(flight(VEHICLE, Start(), hover(VEHICLE, share), 2.0))[-1, 8]
    assert (height_m > 0.1) == flies
    assert flies or abs(height_m) < 0.5e-3


@pytest.mark.parametrize("integrator", ["rk4", "adaptive"])
def test_a_fall_on_the_back_ends_on_the_rotors(integrator: Integrator) -> None:
    fallen = flight(VEHICLE, Start(z=1.5, phi=170.0, vz=-1.0, p=2.0, r=1.0), OFF, 3.0, integrator=integrator)
    height_m = states(fallen)[:, 8]
    end = states(fallen)[-1]
    assert end[:6] == pytest.approx(0.0, abs=1e-3)
    assert height_m[-1] == pytest.approx(-0.05, abs=1e-3) or height_m[-1] == pytest.approx(0.0, abs=1e-3)
    assert height_m.max() <= 1.5


@given(st.floats(-0.2, 0.1), vectors(2.0), vectors(5.0), quaternions())
def test_the_wrench_is_the_sum_over_the_points_that_touch(
    height_m: float, velocity: Vector, rate: Vector, attitude: Quaternion
) -> None:
    ground = VEHICLE.ground
    assert ground is not None
    R = np.array(rotation_matrix(attitude))
    force, moment = np.zeros(3), np.zeros(3)
    for point in VEHICLE.contacts_m():
        depth_m = VEHICLE.ground_height_m - height_m - (R @ point)[2]
        slip = R @ (np.array(velocity) + np.cross(rate, point))
        normal_n = max(0.0, ground.stiffness_n_m * depth_m - ground.damping_n_s_m * slip[2]) * (depth_m > 0.0)
        creeping = ground.slip_damping_n_s_m * slip[:2] * (depth_m > 0.0)
        limit = min(1.0, ground.friction_coefficient * normal_n / max(float(np.linalg.norm(creeping)), 1e-300))
        push = R.T @ np.array([*(-limit * creeping), normal_n])
        force, moment = force + push, moment + np.cross(point, push)
    parameters = packed(parameters_of(VEHICLE, CALM))[0]
    wrench = contact_wrench(height_m, velocity, rate, rotation_matrix(attitude), parameters)
    assert wrench.force_n == pytest.approx(force, abs=1e-8)
    assert wrench.moment_n_m == pytest.approx(moment, abs=1e-8)


def test_it_does_not_start_in_the_ground() -> None:
    with pytest.raises(VehicleError, match=r"would start 0\.5 m below the ground"):
        starting_world(Start(z=-0.5), VEHICLE)
    starting_world(Start(z=-0.5), VEHICLE.without({"ground"}))
    with pytest.raises(VehicleError, match="below the ground"):
        starting_world(Start(phi=60.0), VEHICLE)
