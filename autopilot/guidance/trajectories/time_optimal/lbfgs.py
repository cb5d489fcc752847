"""Minimisation by limited-memory BFGS, as SciPy's sums depend on the CPU.

J. Nocedal and S. J. Wright, "Numerical Optimization" (2006), algorithm 7.4; line search: A. S. Lewis and M. L. Overton,
"Nonsmooth optimization via quasi-Newton methods" (2013), algorithm 2.6.
"""

from collections import deque
from collections.abc import Callable
from math import inf, isfinite
from typing import NamedTuple, TypeAlias

from colibri.common.matrices import dot, norm
from colibri.common.types import Array

Function: TypeAlias = Callable[[Array], tuple[float, Array]]  # x (n,) -> value and gradient (n,)

_MEMORY, _WINDOW = 50, 20  # pairs of steps, and values compared for a stop
_TRIALS = 30
_DECREASE, _CURVATURE = 1e-4, 0.9  # weak Wolfe conditions


class _Point(NamedTuple):
    x: Array
    value: float
    gradient: Array


class _Pair(NamedTuple):
    """A step, the change of the gradient, and their product."""

    step: Array
    change: Array
    product: float


def minimise(function: Function, x: Array, iterations: int, tolerance: float) -> Array:
    """Return a minimum, (n,); stop at improvements below `tolerance` of the value."""
    point = _Point(x, *function(x))
    pairs: deque[_Pair] = deque(maxlen=_MEMORY)
    values = deque([point.value], maxlen=_WINDOW)
    for _ in range(iterations):
        length = 1.0 if pairs else 1.0 / max(norm(point.gradient), 1.0)
        found = _searched(function, point, _direction(point.gradient, pairs), length)
        if found is None and not pairs:
            break
        if found is None:
            pairs.clear()
            continue
        step, change = found.x - point.x, found.gradient - point.gradient
        point, product = found, dot(step, change)
        if product > 0.0:
            pairs.append(_Pair(step, change, product))
        if len(values) == _WINDOW and values[0] - point.value < tolerance * abs(point.value):
            break
        values.append(point.value)
    return point.x


def _direction(gradient: Array, pairs: deque[_Pair]) -> Array:
    direction, weights = -gradient, []
    for step, change, product in reversed(pairs):
        weights.append(dot(step, direction) / product)
        direction = direction - weights[-1] * change
    if pairs:
        last = pairs[-1]
        direction = (last.product / dot(last.change, last.change)) * direction
    for (step, change, product), weight in zip(pairs, reversed(weights), strict=True):
        direction = direction + (weight - dot(change, direction) / product) * step
    return direction


def _searched(function: Function, start: _Point, direction: Array, length: float) -> _Point | None:
    slope = dot(start.gradient, direction)
    low, high, best = 0.0, inf, None
    for _ in range(_TRIALS if slope < 0.0 else 0):
        x = start.x + length * direction
        point = _Point(x, *function(x))
        if not (isfinite(point.value) and point.value <= start.value + _DECREASE * length * slope):
            high = length
        elif dot(point.gradient, direction) < _CURVATURE * slope:
            low, best = length, point
        else:
            return point
        length = 2.0 * low if high == inf else 0.5 * (low + high)
    return best
