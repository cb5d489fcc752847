"""Derivatives of samples by local polynomials: the same bits on every computer."""

import numpy as np

from colibri.common.types import Array

_DEGREE = 4


def local_fit(times_s: Array, values: Array, count: int) -> tuple[Array, Array, Array]:
    """Return the smoothed `values` (n, axes) and their first two derivatives.

    Each is of the least-squares polynomial of degree 4 through the nearest `count` samples.
    """
    n = len(times_s)
    count = min(count, n)
    size = min(_DEGREE, count - 1) + 1
    first = np.clip(np.arange(n) - count // 2, 0, n - count)
    scale_s = 0.5 * (times_s[first + count - 1] - times_s[first])
    moments, sums = np.zeros((2 * size - 1, n)), np.zeros((size, n, values.shape[1]))
    for offset in range(count):
        tau, power = (times_s[first + offset] - times_s) / scale_s, np.ones(n)
        for k in range(2 * size - 1):
            moments[k] += power
            if k < size:
                sums[k] += power[:, None] * values[first + offset]
            power = power * tau
    rows = [[moments[i + j].copy() for j in range(size)] for i in range(size)]
    for i in range(size):
        for below in range(i + 1, size):
            factor = rows[below][i] / rows[i][i]
            for j in range(i, size):
                rows[below][j] -= factor * rows[i][j]
            sums[below] -= factor[:, None] * sums[i]
    for i in reversed(range(size)):
        for j in range(i + 1, size):
            sums[i] -= rows[i][j][:, None] * sums[j]
        sums[i] /= rows[i][i][:, None]
    zero = np.zeros_like(values)
    curvature = 2.0 * sums[2] / (scale_s * scale_s)[:, None] if size > 2 else zero
    return sums[0], sums[1] / scale_s[:, None], curvature
