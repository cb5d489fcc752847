"""The outer loop: forces, attitudes and thrusts against what they stand for."""

from math import pi, tan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.autopilot.control.lpv_mpc import position_loop
from colibri.autopilot.control.lpv_mpc.position_loop import Loop, Motion
from colibri.autopilot.control.parts.thrust_force import ForceLimits
from colibri.autopilot.control.vehicle_model.airframe import Airframe, drag_force
from colibri.common.rotations import quaternion_from_euler, rotation_matrix
from tests.support.strategies import reals, vectors

AIRFRAME = Airframe(0.698, 9.81, 0.025, 0.05, 0.06)
NO_DRAG = Airframe(0.698, 9.81, 0.0, 0.0, 0.0)
LIMITS = ForceLimits(tan(1.0), 1.0, 18.0, 1.0)
MAX_ERROR_M = 1.5
GAINS = (20.0, 9.0)
NOTHING = np.zeros(3)


def forces_for(
    position: np.ndarray,
    velocity: np.ndarray,
    reference: tuple[np.ndarray, np.ndarray, np.ndarray],
    airframe: Airframe = NO_DRAG,
    disturbance: np.ndarray = NOTHING,
) -> np.ndarray:
    forces = np.empty((2, 3))
    r, v, a = (np.tile(part, (2, 1)) for part in reference)
    loop = Loop(*GAINS, np.tile(np.eye(2), (2, 1, 1)), MAX_ERROR_M, airframe, np.ones(3), 1.0, 0.008)
    motion = Motion(position, velocity, np.array([0.0, 0.0, 1.0]), 0.0, 0.0, airframe.mass_kg)
    position_loop.wanted_forces(motion, (r, v, a, np.zeros(2)), disturbance, loop, LIMITS, forces)
    first: np.ndarray = forces[0]
    return first


def test_the_force_is_newtons_for_the_demanded_acceleration() -> None:
    e, e_rate, a, d = (np.array(v) for v in ((0.1, -0.05, 0.08), (0.2, 0.1, -0.1), (0.5, 1.0, -0.3), (0.2, -0.4, 0.6)))
    wanted = 0.698 * (a + 20.0 * e + 9.0 * e_rate - d + np.array([0.0, 0.0, 9.81]))
    assert forces_for(-e, -e_rate, (NOTHING, NOTHING, a), disturbance=d) == pytest.approx(wanted)


@given(vectors(5.0))
def test_with_drag_the_force_holds_a_steady_motion(velocity: tuple[float, float, float]) -> None:
    v = np.array(velocity)
    force = forces_for(NOTHING, v, (NOTHING, v, NOTHING), AIRFRAME)
    thrust = float(np.linalg.norm(force))
    drag = drag_force(AIRFRAME, v, force / thrust, thrust)
    assert force + np.array(drag) - np.array([0.0, 0.0, 0.698 * 9.81]) == pytest.approx(
        NOTHING, abs=2e-3 * (1.0 + v @ v)
    )


def test_a_far_reference_is_approached_at_a_limited_speed() -> None:
    """At the distance that counts at most, feedback is at rest at the speed of approach."""
    far = np.array([100.0, 0.0, 0.0])
    resting = np.array([MAX_ERROR_M * GAINS[0] / GAINS[1], 0.0, 0.0])
    assert forces_for(NOTHING, resting, (far, NOTHING, NOTHING)) == pytest.approx([0.0, 0.0, 0.698 * 9.81])


@given(reals(8.0), reals(8.0), st.floats(0.5, 15.0), reals(pi), reals(pi))
def test_roll_and_pitch_point_thrust_along_the_force_at_any_yaw(
    x: float, y: float, z: float, yaw: float, wanted: float
) -> None:
    angles = np.empty((1, 3))
    position_loop.attitudes(np.array([[x, y, z]]), np.array([wanted]), np.array([yaw]), angles)
    phi, theta, psi = angles[0].tolist()
    up = np.array(rotation_matrix(quaternion_from_euler(phi, theta, yaw)))[:, 2]
    assert up * np.linalg.norm([x, y, z]) == pytest.approx([x, y, z], abs=1e-9)
    assert psi == wanted
