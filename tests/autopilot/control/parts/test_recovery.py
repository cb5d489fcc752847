"""The law for any attitude, and the mixer that gives up what matters least."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from colibri.autopilot.control.parts.recovery import TurnGains, mix_with_priority, turning_moment
from colibri.autopilot.control.vehicle_model.mixer import mixing_of
from colibri.common.rotations import normalized, rotation_matrix
from colibri.common.types import Quaternion, Vector
from colibri.plant.vehicle.description import load_vehicle
from tests.support.strategies import quaternions, reals, vectors

VEHICLE = load_vehicle("hummingbird")
ALLOCATION = VEHICLE.allocation() * VEHICLE.rotors.max_speed**2
MIXING = mixing_of(ALLOCATION)
MIN_SQUARED, MAX_SQUARED = 0.01, 1.0
INERTIA = np.array(VEHICLE.body.inertia_kg_m2)
GAINS = TurnGains(6.0, 20.0, 8.0)


def mixed(thrust_n: float, moment: np.ndarray) -> np.ndarray:
    return mix_with_priority(thrust_n, moment, MIXING, MIN_SQUARED, MAX_SQUARED)


@given(st.floats(-10.0, 40.0), reals(5.0), reals(5.0), reals(2.0))
def test_what_is_mixed_is_within_the_limits(thrust: float, u2: float, u3: float, u4: float) -> None:
    squared = mixed(thrust, np.array([u2, u3, u4]))
    assert (squared >= MIN_SQUARED).all()
    assert (squared <= MAX_SQUARED).all()


@given(st.floats(3.0, 14.0), reals(0.1), reals(0.1), reals(0.02))
def test_what_the_rotors_can_do_is_done(thrust: float, u2: float, u3: float, u4: float) -> None:
    wrench = ALLOCATION @ mixed(thrust, np.array([u2, u3, u4]))
    assert wrench == pytest.approx([thrust, u2, u3, u4], abs=1e-9)


@given(st.floats(-10.0, 40.0), reals(0.35), reals(0.35), reals(2.0))
def test_tilting_moments_come_before_thrust_and_yaw(thrust: float, u2: float, u3: float, u4: float) -> None:
    wrench = ALLOCATION @ mixed(thrust, np.array([u2, u3, u4]))
    assert wrench[1:3] == pytest.approx([u2, u3], abs=1e-9)
    assert abs(wrench[3]) <= abs(u4) + 1e-9
    assert wrench[3] * u4 >= -1e-9


def test_too_much_tilting_moment_keeps_its_direction() -> None:
    wrench = ALLOCATION @ mixed(6.0, np.array([4.0, 2.0, 0.0]))
    assert wrench[1] / wrench[2] == pytest.approx(2.0)
    assert wrench[1] > 0.3


@settings(max_examples=15)
@given(quaternions(), vectors(10.0))
def test_the_thrust_axis_gets_where_it_must_point(q: Quaternion, rate: Vector) -> None:
    (ix, iy, iz), omega, attitude, h = INERTIA, np.array(rate), q, 1e-3
    for _ in range(3000):
        direction = np.array(rotation_matrix(attitude)).T @ [0.0, 0.0, 1.0]
        moment = turning_moment(direction, omega, INERTIA, GAINS)
        p, r, s = omega
        gyroscopic = [(iz - iy) * r * s, (ix - iz) * s * p, (iy - ix) * p * r]
        omega = omega + h * (moment - gyroscopic) / INERTIA
        w, x, y, z = attitude
        p, r, s = 0.5 * h * omega
        attitude = normalized(
            (w - x * p - y * r - z * s, x + w * p + y * s - z * r, y + w * r + z * p - x * s, z + w * s + x * r - y * p)
        )
    assert rotation_matrix(attitude)[2][2] > 0.999
    assert omega == pytest.approx(np.zeros(3), abs=0.05)


def test_turns_are_no_faster_than_allowed() -> None:
    moment = turning_moment(np.array([0.0, 0.0, -1.0]), np.array([8.0, 0.0, 0.0]), INERTIA, GAINS)
    assert moment == pytest.approx(np.zeros(3))
