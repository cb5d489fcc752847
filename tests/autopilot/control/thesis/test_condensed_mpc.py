"""The condensed QP against the cost that it condenses."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.autopilot.control.thesis.condensed_mpc import IncrementModel, Weights, augment, condense
from colibri.autopilot.control.thesis.lpv_model import ATTITUDE_OUTPUT, attitude_model, discretise
from colibri.common.types import Array

INERTIA = (0.0034, 0.0041, 0.006)
WEIGHTS = Weights(np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0]), np.array([7.0, 8.0, 9.0]))


def model() -> IncrementModel:
    A, B = attitude_model(0.4, -0.7, 0.004, inertia_kg_m2=INERTIA)
    return augment(discretise(A, B, 0.1, "zero-order-hold"), ATTITUDE_OUTPUT)


def cost(horizon: int, x: Array, reference: Array, increments: Array) -> float:
    """The cost of THESIS [3.18], by simulation: errors of every step, increments of every step."""
    A, B, C = model()
    total = 0.0
    for step in range(horizon):
        x = A @ x + B @ increments[step]
        error = reference[step] - C @ x
        weight = WEIGHTS.terminal if step == horizon - 1 else WEIGHTS.output
        total += 0.5 * error @ (weight * error) + 0.5 * increments[step] @ (WEIGHTS.increment * increments[step])
    return float(total)


@given(st.integers(1, 12), st.integers(0, 2**32 - 1))
def test_the_condensed_cost_is_the_simulated_one(horizon: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, reference = rng.normal(size=9), rng.normal(size=(horizon, 3))
    qp = condense(model(), horizon, x, reference, WEIGHTS)
    one, other = rng.normal(size=(2, horizon, 3))

    def condensed(increments: Array) -> float:
        flat = increments.ravel()
        return float(0.5 * flat @ qp.H @ flat + qp.f @ flat)

    simulated = cost(horizon, x, reference, one) - cost(horizon, x, reference, other)
    assert condensed(one) - condensed(other) == pytest.approx(simulated, rel=1e-7, abs=1e-7)
