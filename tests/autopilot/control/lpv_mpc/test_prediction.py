"""The LPV model over a horizon: exact kinematics, exact hold, superposition."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.autopilot.control.lpv_mpc.prediction import ANGLES, M1, PHI, RATES, SCHEDULE, STATES, THETA, Body, flow
from colibri.common.rotations import euler_rates

BODY = Body(0.0034, 0.0034, 0.006, 40.0)
MOMENTUM = 3e-4


def random_state(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.uniform(-1.0, 1.0, STATES) * [1.2, 4, 1.2, 4, 3, 2, 0.05, 0.05, 0.01]


@given(st.integers(0, 10_000))
def test_at_its_scheduling_point_the_model_is_the_nonlinear_one(seed: int) -> None:
    """Newton-Euler with the rotors' momentum, THESIS [2.8] with erratum 2, and T(phi, theta) of [2.7]: nothing lost."""
    x = random_state(seed)
    derivative = np.empty((STATES, 1))
    flow(x[list(SCHEDULE)], MOMENTUM, BODY, x[:, None].copy(), derivative)
    p, q, r = (float(x[i]) for i in RATES)
    m1, m2, m3 = x[M1:]
    ix, iy, iz, lag_1_s = BODY
    assert derivative[list(ANGLES), 0] == pytest.approx(euler_rates(float(x[PHI]), float(x[THETA]), (p, q, r)))
    assert derivative[list(RATES), 0] == pytest.approx(
        [
            (q * r * (iy - iz) - q * MOMENTUM + m1) / ix,
            (p * r * (iz - ix) + p * MOMENTUM + m2) / iy,
            (p * q * (ix - iy) + m3) / iz,
        ]
    )
    assert derivative[M1:, 0] == pytest.approx(-lag_1_s * x[M1:])
