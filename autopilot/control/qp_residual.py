"""Compiled residual of a QP's optimality conditions."""

from math import inf, isfinite

from colibri.common.jit import compiled
from colibri.common.types import Array


@compiled
def residual(
    H: Array, f: Array, G: Array, h: Array, lower: Array, upper: Array, x: Array, z: Array, z_box: Array
) -> float:
    """Return the largest violation of a constraint, or of stationarity in parts of f; inf if not finite.

    The multipliers z of G x <= h are (m,), and those of the bounds, z_box, (n,), negative at a lower bound; or (0,) if
    unknown: then only feasibility counts.
    """
    n, m = G.shape[1], G.shape[0]
    has_multipliers = z.shape[0] == m and z_box.shape[0] >= lower.shape[0]
    missed, scale, total = 0.0, 1.0, 0.0
    gradient = f.copy()
    for i in range(n):
        total += x[i]
        scale = max(scale, 1.0 + abs(f[i]))
        for k in range(n):
            gradient[i] += H[i, k] * x[k]
        if z_box.shape[0] > 0:
            gradient[i] += z_box[i]
        if lower.shape[0] > 0:
            missed = max(missed, lower[i] - x[i], x[i] - upper[i])
    for row in range(m):
        excess = -h[row]
        for k in range(n):
            excess += G[row, k] * x[k]
        missed = max(missed, excess)
        if has_multipliers and z[row] != 0.0:
            for k in range(n):
                gradient[k] += z[row] * G[row, k]
    if has_multipliers:
        for i in range(n):
            total += gradient[i]
            missed = max(missed, abs(gradient[i]) / scale)
    return missed if isfinite(total) else inf
