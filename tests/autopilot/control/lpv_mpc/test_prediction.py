"""The LPV model over a horizon: exact kinematics, exact hold, superposition."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from colibri.autopilot.control.lpv_mpc.prediction import (
    ANGLES,
    INPUTS,
    M1,
    PHI,
    RATES,
    SCHEDULE,
    STATES,
    THETA,
    Body,
    InitialState,
    flow,
    respond,
)
from colibri.common.rotations import euler_rates

BODY = Body(0.0034, 0.0034, 0.006, 40.0)
MOMENTUM = 3e-4
INTERVAL_S = 0.008
STARTS = np.array([0, 1, 4, 9])
STEPS = 16


def random_state(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.uniform(-1.0, 1.0, STATES) * [1.2, 4, 1.2, 4, 3, 2, 0.05, 0.05, 0.01]


def predicted(x: np.ndarray, u: np.ndarray, d: np.ndarray, schedule: np.ndarray, body: Body) -> np.ndarray:
    responses = np.full((len(schedule) + 1, STATES, 1 + INPUTS * len(STARTS)), np.nan)
    respond(InitialState(x, u, d, MOMENTUM, 1.0), schedule, body, STARTS, INTERVAL_S, responses)
    return responses


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


@pytest.mark.parametrize("seed", range(5))
def test_a_step_is_a_zero_order_hold(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, u, d = random_state(seed), rng.normal(size=3) * 0.05, rng.normal(size=3) * 0.01
    schedule = np.array([random_state(100 * seed + step)[list(SCHEDULE)] for step in range(STEPS)])
    responses = predicted(x, u, d, schedule, BODY)
    increments = rng.normal(size=(len(STARTS), INPUTS)) * 0.02
    held, state = u.copy(), x.copy()
    for step in range(STEPS):
        if step in STARTS:
            held = held + increments[list(STARTS).index(step)]
        A = np.empty((STATES, STATES))
        flow(schedule[step], MOMENTUM, BODY, np.eye(STATES), A)
        block = np.zeros((STATES + 1, STATES + 1))
        block[:STATES, :STATES] = A
        block[M1:STATES, STATES] = BODY.lag_1_s * held
        block[list(RATES), STATES] = d / BODY[:3]
        state = (expm(block * INTERVAL_S) @ [*state, 1.0])[:STATES]
        assert responses[step + 1] @ [1.0, *increments.ravel()] == pytest.approx(state, rel=1e-3, abs=1e-4)
