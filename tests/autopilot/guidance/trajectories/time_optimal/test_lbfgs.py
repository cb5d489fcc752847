"""The minimiser: where it ends, on what is smooth, narrow or bent, and that it ends at all."""

import numpy as np
import pytest

from colibri.autopilot.guidance.trajectories.time_optimal.lbfgs import Function, minimise
from colibri.common.types import Array


def bowl(x: Array) -> tuple[float, Array]:
    curvature = 10.0 ** np.linspace(0.0, 2.0, len(x))
    return float((0.5 * curvature * (x - 1.0) * (x - 1.0)).sum()), curvature * (x - 1.0)


def valley(x: Array) -> tuple[float, Array]:
    """Rosenbrock's."""
    a, b = x[1] - x[0] * x[0], 1.0 - x[0]
    return float(100.0 * a * a + b * b), np.array([-400.0 * x[0] * a - 2.0 * b, 200.0 * a])


def penalised(x: Array) -> tuple[float, Array]:
    """Least at 1 - 1 / 200, where a penalty of bent curvature begins at 1."""
    below = max(1.0 - float(x[0]), 0.0)
    return float(x[0]) + 100.0 * below * below, np.array([1.0 - 200.0 * below])


@pytest.mark.parametrize(
    ("function", "start", "least"),
    [
        (bowl, np.zeros(30), np.ones(30)),
        (valley, np.array([-1.2, 1.0]), np.ones(2)),
        (penalised, np.array([9.0]), np.array([0.995])),
    ],
)
def test_it_ends_where_the_function_is_least(function: Function, start: Array, least: Array) -> None:
    assert minimise(function, start, 200, 1e-14) == pytest.approx(least, abs=1e-4)


def test_it_takes_no_more_iterations_than_it_is_given() -> None:
    calls = []

    def counted(x: Array) -> tuple[float, Array]:
        calls.append(x)
        return valley(x)

    minimise(counted, np.array([-1.2, 1.0]), 5, 0.0)
    assert len(calls) <= 1 + 5 * 30


def test_what_is_not_finite_is_gone_round() -> None:
    """Beyond 2 there is nothing; the first steps lead there."""

    def walled(x: Array) -> tuple[float, Array]:
        if x[0] > 2.0:
            return float("inf"), np.array([np.nan])
        return float(-x[0] + x[0] ** 4 / 16.0), np.array([-1.0 + x[0] ** 3 / 4.0])

    assert minimise(walled, np.array([-30.0]), 200, 1e-14) == pytest.approx(4.0 ** (1.0 / 3.0), abs=1e-5)
