"""Piecewise polynomials through points that minimise a squared derivative.

D. Mellinger and V. Kumar, ICRA 2011; solved as in C. Richter, A. Bry and N. Roy, ISRR 2013: the unknowns are
derivatives at inner points, so that the system is positive definite and couples only neighbours.
"""

from dataclasses import dataclass
from math import factorial, perm

import numpy as np

from colibri.autopilot.guidance.trajectories.taylor import TaylorSeries
from colibri.common.jit import compiled
from colibri.common.matrices import inverse, matmul, solve
from colibri.common.types import Array

SNAP = 4
ACCELERATION = 2


@dataclass(frozen=True, slots=True)
class PiecewisePolynomial:
    """Polynomials between knots `times_s`, (n,); coefficients in own time 0 to 1, (n - 1, powers, axes)."""

    times_s: Array
    coefficients: Array

    def __call__(self, t: TaylorSeries) -> tuple[TaylorSeries, ...]:
        after = np.searchsorted(self.times_s, t.coefficients[0], side="right")
        piece = np.clip(after - 1, 0, len(self.times_s) - 2)
        tau = (t - self.times_s[piece]) * (1.0 / np.diff(self.times_s)[piece])
        return tuple(_horner(self.coefficients[piece, :, axis], tau) for axis in range(self.coefficients.shape[2]))


def minimise(order: int, times_s: Array, points: Array) -> PiecewisePolynomial:
    """Return the curve through `points` (n, axes) at `times_s`, n >= 2, at rest at both ends.

    `order` is `SNAP` or `ACCELERATION`; derivatives up to 2 order - 2 are continuous.
    """
    return interpolate(times_s, minimal_knots(elements(np.diff(times_s), stiffness(order)), points))


def minimal_knots(elements: Array, points: Array) -> Array:
    """Return the optimal derivatives at `points` (n, axes), order 0 first, (n, order, axes)."""
    knots = np.zeros((len(points), elements.shape[2], points.shape[1]))
    knots[:, 0] = points
    if len(points) > 2:
        knots[1:-1, 1:] = _free_derivatives(elements, points)
    return knots


def interpolate(times_s: Array, knots: Array) -> PiecewisePolynomial:
    """Return Hermite's interpolation of the derivatives `knots`, order 0 first, (n, order, axes)."""
    _, order, axes = knots.shape
    durations = np.diff(times_s)
    both = np.concatenate([knots[:-1], knots[1:]], axis=1)
    in_own_time = both * np.tile(powers(durations, order), 2)[:, :, None]
    coefficients = matmul(from_ends(order), np.moveaxis(in_own_time, 0, 1).reshape(2 * order, -1))
    return PiecewisePolynomial(times_s, np.moveaxis(coefficients.reshape(2 * order, len(durations), axes), 1, 0))


def from_ends(order: int) -> Array:
    """Return the matrix from derivatives at 0, then at 1, to coefficients."""
    columns = range(2 * order)
    at_0 = [[float(factorial(k)) if power == k else 0.0 for power in columns] for k in range(order)]
    at_1 = [[float(perm(power, k)) for power in columns] for k in range(order)]
    return inverse(np.array(at_0 + at_1))


def stiffness(order: int) -> Array:
    """Return the integral of the squared derivative from 0 to 1 as a form of end derivatives."""
    columns = range(2 * order)

    def entry(i: int, j: int) -> float:
        return perm(i, order) * perm(j, order) / (i + j - 2 * order + 1) if min(i, j) >= order else 0.0

    cost, to_coefficients = np.array([[entry(i, j) for j in columns] for i in columns]), from_ends(order)
    return matmul(matmul(to_coefficients.T, cost), to_coefficients)


def powers(durations: Array, order: int) -> Array:
    """Return factors from derivatives per second to per segment."""
    powers = np.ones((len(durations), order))
    powers[:, 1:] = durations[:, None]
    return np.cumprod(powers, axis=1, dtype=np.float64)


def elements(durations: Array, stiffness: Array) -> Array:
    """Return each segment's cost as a form of end derivatives, (segments, end, order, end, order)."""
    order = len(stiffness) // 2
    scale = np.tile(powers(durations, order), 2)
    forms = stiffness * scale[:, :, None] * scale[:, None, :] / powers(durations, 2 * order)[:, -1:, None]
    return forms.reshape(-1, 2, order, 2, order)


def _free_derivatives(elements: Array, points: Array) -> Array:
    before, after = elements[:-1], elements[1:]
    pull = (
        before[:, 1, 1:, 0, :1] * points[:-2, None]
        + (before[:, 1, 1:, 1, :1] + after[:, 0, 1:, 0, :1]) * points[1:-1, None]
        + after[:, 0, 1:, 1, :1] * points[2:, None]
    )
    return balanced(elements, -pull)


def balanced(elements: Array, forces: Array) -> Array:
    """Solve curvature · derivatives = `forces` for the inner points by block elimination, (n - 2, order - 1, axes)."""
    before, after = elements[:-1], elements[1:]
    curvature = before[:, 1, 1:, 1, 1:] + after[:, 0, 1:, 0, 1:]
    coupling = after[:-1, 0, 1:, 1, 1:]
    return _eliminated(curvature, np.ascontiguousarray(coupling), forces.copy())


@compiled
def _eliminated(curvature: Array, coupling: Array, free: Array) -> Array:
    through = np.empty_like(coupling)
    for k in range(len(coupling)):
        block = coupling[k]
        _put(solve(curvature[k], block), through[k])
        _put(solve(curvature[k], free[k]), free[k])
        _reduce(matmul(block.T, through[k]), curvature[k + 1])
        _reduce(matmul(block.T, free[k]), free[k + 1])
    _put(solve(curvature[-1], free[-1]), free[-1])
    for k in range(len(coupling) - 1, -1, -1):
        _reduce(matmul(through[k], free[k + 1]), free[k])
    return free


@compiled
def _put(values: Array, out: Array) -> None:
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = values[i, j]


@compiled
def _reduce(values: Array, out: Array) -> None:
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] -= values[i, j]


def _horner(coefficients: Array, x: TaylorSeries) -> TaylorSeries:
    value = x * 0.0 + coefficients[:, -1]
    for coefficient in coefficients[:, -2::-1].T:
        value = value * x + coefficient
    return value
