from math import cos, pi, sin

import numpy as np
import pytest
from hypothesis import given

from colibri.common import rotations
from colibri.common.types import Quaternion, Vector
from colibri.mavlink.wire import ned
from tests.support.strategies import ANGLES, TILTS, quaternions, vectors


def test_axes_of_the_conversions() -> None:
    assert ned.ned_from_enu((1.0, 2.0, 3.0)) == (2.0, 1.0, -3.0)
    assert ned.frd_from_flu((1.0, 2.0, 3.0)) == (1.0, -2.0, -3.0)


@given(quaternions(), vectors())
def test_attitude_conversion_agrees_with_the_vector_conversions(q: Quaternion, v: Vector) -> None:
    over_enu = ned.ned_from_enu(rotations.earth_from_body(q, v))
    over_ned = rotations.earth_from_body(ned.ned_frd_from_enu_flu(q), ned.frd_from_flu(v))
    assert over_ned == pytest.approx(over_enu, abs=1e-9)


@given(ANGLES, TILTS, ANGLES)
def test_euler_round_trip(phi: float, theta: float, psi: float) -> None:
    q = rotations.quaternion_from_euler(phi, theta, psi)
    again = rotations.quaternion_from_euler(*rotations.euler_from_quaternion(q))
    assert abs(abs(float(np.dot(again, q))) - 1.0) < 1e-12


def test_euler_angles_stay_finite_at_gimbal_lock() -> None:
    phi, theta, psi = rotations.euler_from_quaternion(rotations.quaternion_from_euler(0.3, pi / 2, 0.1))
    assert theta == pytest.approx(pi / 2, abs=1e-7)
    assert abs(phi) <= pi
    assert abs(psi) <= pi


@given(ANGLES, TILTS, ANGLES)
def test_rotation_matrix_is_the_one_of_the_thesis(phi: float, theta: float, psi: float) -> None:
    roll = np.array([[1, 0, 0], [0, cos(phi), -sin(phi)], [0, sin(phi), cos(phi)]])
    pitch = np.array([[cos(theta), 0, sin(theta)], [0, 1, 0], [-sin(theta), 0, cos(theta)]])
    yaw = np.array([[cos(psi), -sin(psi), 0], [sin(psi), cos(psi), 0], [0, 0, 1]])
    R = rotations.rotation_matrix(rotations.quaternion_from_euler(phi, theta, psi))
    assert np.array(R) == pytest.approx(yaw @ pitch @ roll, abs=1e-12)


@given(quaternions(), vectors())
def test_rotations_keep_length_and_undo(q: Quaternion, v: Vector) -> None:
    w, x, y, z = q
    rotated = rotations.earth_from_body(q, v)
    assert np.linalg.norm(rotated) == pytest.approx(np.linalg.norm(v), abs=1e-9)
    assert rotations.earth_from_body((w, -x, -y, -z), rotated) == pytest.approx(v, abs=1e-9)


@given(ANGLES, TILTS, vectors(10.0))
def test_euler_rates_are_the_derivative_of_the_angles(phi: float, theta: float, rate: Vector) -> None:
    phi_rate, theta_rate, psi_rate = rotations.euler_rates(phi, theta, rate)
    from_body_rates = np.array(
        [
            phi_rate - sin(theta) * psi_rate,
            cos(phi) * theta_rate + sin(phi) * cos(theta) * psi_rate,
            -sin(phi) * theta_rate + cos(phi) * cos(theta) * psi_rate,
        ]
    )
    assert from_body_rates == pytest.approx(np.array(rate), abs=1e-9)


@given(ANGLES, ANGLES.map(lambda angle: 20.0 * angle))
def test_nearest_turn(angle: float, reference: float) -> None:
    turned = rotations.nearest_turn(angle, reference)
    assert abs(turned - reference) <= pi + 1e-9
    assert (turned - angle) / (2 * pi) == pytest.approx(round((turned - angle) / (2 * pi)), abs=1e-9)


def test_zero_quaternion_is_refused() -> None:
    with pytest.raises(ValueError, match="zero quaternion"):
        rotations.normalized((0.0, 0.0, 0.0, 0.0))
