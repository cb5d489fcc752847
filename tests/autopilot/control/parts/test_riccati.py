"""The regulator: its cost and gain are those of the Riccati equation, as SciPy solves it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import solve_discrete_are

from colibri.autopilot.control.parts.riccati import lqr


@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.integers(1, 4))
def test_cost_and_gain_are_those_of_the_riccati_equation(seed: int, n: int, m: int) -> None:
    random = np.random.default_rng(seed)
    A = 0.5 * np.eye(n) + random.standard_normal((n, n)) / (2.0 * np.sqrt(n))
    B = random.standard_normal((n, m))
    Q, R = np.diag(random.uniform(0.1, 4.0, n)), np.diag(random.uniform(0.1, 2.0, m))
    S, K = lqr(A, B, Q, R)
    expected = solve_discrete_are(A, B, Q, R)
    assert pytest.approx(expected, rel=1e-6, abs=1e-8) == S
    assert pytest.approx(np.linalg.solve(R + B.T @ S @ B, B.T @ S @ A), rel=1e-6, abs=1e-8) == K
