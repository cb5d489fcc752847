"""How well a point satisfies a QP's optimality conditions, as a compiled kernel."""

from math import inf, isfinite

from colibri.common.jit import compiled
from colibri.common.types import Array


@compiled
def residual(
    H: Array, f: Array, G: Array, h: Array, lower: Array, upper: Array, x: Array, z: Array, z_box: Array
) -> float:
    """Return by how much a solution misses the optimality conditions: by its worst constraint, or gradient over f.

    Infinite where x, or the gradient there, is not finite.

    Args:
        H: (n, n).
        f: (n,).
        G: (m, n), of G x <= h.
        h: (m,).
        lower: (n,), or (0,) for no bounds.
        upper: (n,), or (0,) for no bounds.
        x: The solution, (n,).
        z: Multipliers of G x <= h, (m,), or (0,) where the solver gives none.
        z_box: Multipliers of the bounds, (n,), negative at a lower one; or (0,).

    Where there are not as many multipliers as constraints, only feasibility counts.
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
