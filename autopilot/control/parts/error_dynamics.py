"""Position error dynamics: a double integrator with placed poles."""

import numpy as np

from colibri.common import elementwise
from colibri.common.types import Array


def gains(poles: tuple[float, float]) -> tuple[float, float]:
    """Return the gains on an error, 1/s², and on its rate, 1/s, for two poles, 1/s."""
    first, second = poles
    return first * second, -(first + second)


def error_transition(poles: tuple[float, float], interval_s: float, samples: int) -> Array:
    """Return the transition of error and rate from now to each sample, (samples, 2, 2)."""
    first, second = poles
    t = interval_s * np.arange(samples, dtype=np.float64)
    if first == second:
        decay = elementwise.exp(first * t)
        rows = [[(1.0 - first * t) * decay, t * decay], [-first * first * t * decay, (1.0 + first * t) * decay]]
    else:
        a, b = elementwise.exp(first * t), elementwise.exp(second * t)
        apart = first - second
        rows = [
            [(first * b - second * a) / apart, (a - b) / apart],
            [first * second * (b - a) / apart, (first * a - second * b) / apart],
        ]
    return np.ascontiguousarray(np.moveaxis(np.array(rows), -1, 0))
