"""Minimum snap: what it passes, how smooth it is, and that nothing is smoother."""

from math import perm

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad_vec
from scipy.linalg import solve

from colibri.autopilot.guidance.trajectories.minimum_snap import ACCELERATION, SNAP, PiecewisePolynomial, minimise
from colibri.autopilot.guidance.trajectories.taylor import TaylorSeries
from colibri.common.types import Array
from tests.support.strategies import reals

TIMES_S = np.array([0.0, 1.5, 2.0, 5.0, 6.0])
POINTS = np.array([[0.0, 1.0], [3.0, 1.0], [3.0, 4.0], [-2.0, 0.0], [0.0, 0.0]])


def derivatives(curve: PiecewisePolynomial, t: Array, order: int) -> Array:
    return np.stack([axis.derivative(order) for axis in curve(TaylorSeries.time(t, order))], axis=1)


def cost(curve: PiecewisePolynomial, order: int) -> float:
    def squared(t: float) -> float:
        return float((derivatives(curve, np.array([t]), order) ** 2).sum())

    edges = zip(curve.times_s, np.nextafter(curve.times_s[1:], 0.0), strict=False)
    return float(sum(quad_vec(squared, begin, end)[0] for begin, end in edges))


def legs() -> st.SearchStrategy[list[tuple[float, tuple[float, float]]]]:
    """Durations and the points at their ends."""
    return st.lists(st.tuples(st.floats(0.05, 100.0), st.tuples(reals(100.0), reals(100.0))), min_size=1, max_size=12)


@settings(max_examples=200, deadline=None)
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


@pytest.mark.parametrize("order", [pytest.param(SNAP, marks=pytest.mark.long), ACCELERATION])
def test_no_other_way_through_the_points_costs_less(order: int) -> None:
    """What is added is zero, with its derivatives below `order`, at both ends, and passes zero at every point."""
    best = minimise(order, TIMES_S, POINTS)
    minimum = cost(best, order)
    rng = np.random.default_rng(0)
    for _ in range(3):
        values = rng.normal(size=(len(TIMES_S) * 2 - 1, 2))
        values[::2] = 0.0
        finer = np.sort(np.concatenate([TIMES_S, TIMES_S[:-1] + 0.4 * np.diff(TIMES_S)]))
        detour = minimise(order, finer, values)
        rising = [_cost_of_sum(best, detour, share, order) for share in (-1e-3, 1e-3)]
        assert min(rising) > minimum
        assert rising[0] - minimum == pytest.approx(rising[1] - minimum, rel=1e-4), "no slope: it is stationary"


def _cost_of_sum(one: PiecewisePolynomial, other: PiecewisePolynomial, share: float, order: int) -> float:
    def squared(t: float) -> float:
        at = np.array([t])
        both = derivatives(one, at, order) + share * derivatives(other, at, order)
        return float((both**2).sum())

    edges = zip(other.times_s, np.nextafter(other.times_s[1:], 0.0), strict=False)
    return float(sum(quad_vec(squared, begin, end, epsrel=1e-12)[0] for begin, end in edges))


@pytest.mark.parametrize("order", [SNAP, ACCELERATION])
def test_two_segments_against_the_whole_optimality_system(order: int) -> None:
    """The KKT system over raw coefficients in seconds: cost, and constraints as few as the problem states."""
    times_s, points = np.array([0.0, 1.3, 3.0]), np.array([0.5, 2.0, -1.0])
    powers = 2 * order
    H, rows, wanted = np.zeros((2 * powers, 2 * powers)), [], []

    def row(segment: int, t: float, derivative: int) -> Array:
        entries = np.zeros(2 * powers)
        for k in range(derivative, powers):
            entries[segment * powers + k] = perm(k, derivative) * t ** (k - derivative)
        return entries

    for segment in range(2):
        duration = times_s[segment + 1] - times_s[segment]
        for i in range(order, powers):
            for j in range(order, powers):
                exponent = i + j - 2 * order + 1
                entry = perm(i, order) * perm(j, order) * duration**exponent / exponent
                H[segment * powers + i, segment * powers + j] = entry
        rows += [row(segment, 0.0, 0), row(segment, duration, 0)]
        wanted += [points[segment], points[segment + 1]]
    for below in range(1, order):
        rows += [row(0, 0.0, below), row(1, 1.7, below), row(0, 1.3, below) - row(1, 0.0, below)]
        wanted += [0.0, 0.0, 0.0]
    A = np.array(rows)
    system = np.block([[2.0 * H, A.T], [A, np.zeros((len(A), len(A)))]])
    solution = solve(system, np.concatenate([np.zeros(2 * powers), wanted]))[: 2 * powers].reshape(2, powers)
    ours = minimise(order, times_s, points[:, None]).coefficients[:, :, 0]
    assert ours / np.array([[1.3], [1.7]]) ** np.arange(powers) == pytest.approx(solution, rel=1e-8, abs=1e-8)


def test_rest_to_rest_is_the_known_polynomial() -> None:
    curve = minimise(SNAP, np.array([0.0, 1.0]), np.array([[0.0], [1.0]]))
    assert curve.coefficients[0, :, 0] == pytest.approx([0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0])


def test_yaw_is_the_clamped_cubic_spline() -> None:
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(TIMES_S, POINTS, bc_type="clamped")
    t = np.linspace(0.0, 6.0, 101)
    assert derivatives(minimise(ACCELERATION, TIMES_S, POINTS), t, 1) == pytest.approx(spline(t, 1))


def test_many_points() -> None:
    rng = np.random.default_rng(1)
    points, times_s = rng.normal(size=(5_000, 3)), np.cumsum(rng.uniform(0.05, 0.7, size=5_000))
    curve = minimise(SNAP, times_s, points)
    assert derivatives(curve, times_s, 0) == pytest.approx(points, abs=1e-9)
