import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.autopilot.guidance.trajectories.minimum_snap import ACCELERATION, SNAP, PiecewisePolynomial, minimise
from colibri.autopilot.guidance.trajectories.taylor import TaylorSeries
from colibri.common.types import Array
from tests.support.strategies import reals

TIMES_S = np.array([0.0, 1.5, 2.0, 5.0, 6.0])
POINTS = np.array([[0.0, 1.0], [3.0, 1.0], [3.0, 4.0], [-2.0, 0.0], [0.0, 0.0]])


def derivatives(curve: PiecewisePolynomial, t: Array, order: int) -> Array:
    return np.stack([axis.derivative(order) for axis in curve(TaylorSeries.time(t, order))], axis=1)


def legs() -> st.SearchStrategy[list[tuple[float, tuple[float, float]]]]:
    """Durations and the points at their ends."""
    return st.lists(st.tuples(st.floats(0.05, 100.0), st.tuples(reals(100.0), reals(100.0))), min_size=1, max_size=12)


@given(legs(), st.sampled_from([SNAP, ACCELERATION]))
def test_it_passes_every_point_in_time_and_rests_at_both_ends(
    path: list[tuple[float, tuple[float, float]]], order: int
) -> None:
    times_s = np.cumsum([0.0, *(duration for duration, _ in path)])
    points = np.array([(1.0, 2.0), *(point for _, point in path)])
    curve = minimise(order, times_s, points)
    size = np.abs(curve.coefficients).max() + 1.0
    assert derivatives(curve, times_s, 0) == pytest.approx(points, abs=1e-12 * size)
    ends, edges_s = times_s[[0, -1]], np.diff(times_s)[[0, -1]]
    for below in range(1, order):
        resting = derivatives(curve, ends, below) * edges_s[:, None] ** below
        assert resting[0] == pytest.approx(0.0, abs=0.0), "exactly: a direction can be read off what comes next"
        assert resting[1] == pytest.approx(0.0, abs=1e-10 * size)


@pytest.mark.parametrize("order", [SNAP, ACCELERATION])
def test_derivatives_are_continuous_up_to_twice_the_order(order: int) -> None:
    """Up to the third by construction, and from there to the sixth because it is the minimum."""
    curve = minimise(order, TIMES_S, POINTS)
    inner = TIMES_S[1:-1]
    for below in range(2 * order - 1):
        before, after = (derivatives(curve, t, below) for t in (inner - 1e-12, inner))
        assert before == pytest.approx(after, abs=1e-7 * (1.0 + np.abs(after).max()))
    before, after = (derivatives(curve, t, 2 * order - 1) for t in (inner - 1e-12, inner))
    assert np.abs(before - after).max() > 1.0, "the next one jumps"
