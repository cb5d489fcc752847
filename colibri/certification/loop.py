"""A sampled closed loop that is known only to lie in a polytope: what every certificate is about.

    z[k+1] = A z[k] + E ξ[k] + B w[k],   A in the convex hull of the vertices,
    |ξ_i| <= Σ_j N_ij |(Y z)_j| + D_i,   |w| <= 1

Whatever A, ξ and w are at each sample, within these bounds: time-varying, and as bad as can be. A control law is
certified by handing in such loops, one for each scale of the ranges that its model is scheduled by. Matrices are of
float64 for the solver, or of `fractions.Fraction` for the check of what it found; everything here works on both.
"""

from collections.abc import Callable
from fractions import Fraction
from math import lcm
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from colibri.common.errors import Error
from colibri.common.types import Array

AnyArray: TypeAlias = NDArray[Any]
"""Of floats or of fractions."""
Number: TypeAlias = Callable[[float], Any]
"""`float`, or `fractions.Fraction`: what numbers are made into."""


_DIGITS = 9
"""To which floats are compared."""


class RangeError(Error):
    """Ranges for which no loop can be bounded."""


class UncertainLoop(NamedTuple):
    """A closed loop of n states, m rows of ξ and k channels that it depends on.

    Attributes:
        vertices: A, (v, n, n).
        entries: E, (n, m).
        channels: Y, (k, n).
        gains: N, (m, k), not negative.
        offsets: D, (m,), not negative: what the disturbance adds to them.
        disturbance: B, (n, d), of a disturbance w whose length is at most 1.
        limits: Rows f, (l, n): |f z| <= 1 keeps the loop where its bounds hold and its actuators follow.
        starts: States, (s, n), that a set of starts should hold, in proportion: each along one axis.
        stage: Weight of what the law's cost counts at each sample, (n, n).
        mirrors: Signs of states, (g, n), under each of which the polytope is its own image.
    """

    vertices: AnyArray
    entries: AnyArray
    channels: AnyArray
    gains: AnyArray
    offsets: AnyArray
    disturbance: AnyArray
    limits: AnyArray
    starts: AnyArray
    stage: AnyArray
    mirrors: Array

    def blocks(self) -> list[list[int]]:
        """Return the states that a Lyapunov function has to couple: those that no mirror tells apart.

        With P every one of its images is a solution, and so is their mean, which couples no others.
        """
        found: dict[tuple[float, ...], list[int]] = {}
        for state, signs in enumerate(self.mirrors.T.tolist()):
            found.setdefault(tuple(signs), []).append(state)
        return list(found.values())

    def distinct(self) -> "UncertainLoop":
        """Return the loop without vertices that are the image of another: what is proven of that holds for them."""
        signs = np.unique(np.vstack([np.ones_like(self.mirrors[:1]), self.mirrors, self.mirrors.prod(axis=0)]), axis=0)
        kept: dict[Any, int] = {}
        for i, A in enumerate(self.vertices):
            if not any(_key(row[:, None] * A * row) in kept for row in signs):
                kept[_key(A)] = i
        return self._replace(vertices=self.vertices[list(kept.values())])

    def undisturbed(self) -> "UncertainLoop":
        """Return the loop without disturbance."""
        return self._replace(offsets=0 * self.offsets, disturbance=self.disturbance[:, :0]).reduced()

    def reduced(self) -> "UncertainLoop":
        """Return the loop without rows of ξ that are always zero, and without channels that none depends on."""
        rows, columns = (self.gains != 0).any(axis=1) | (self.offsets != 0), (self.gains != 0).any(axis=0)
        return self._replace(
            entries=self.entries[:, rows],
            channels=self.channels[columns],
            gains=self.gains[np.ix_(rows, columns)],
            offsets=self.offsets[rows],
        )


class Supply(NamedTuple):
    """ξ_i² <= zᵀ F_i z + g_i, which follows from the bounds on |ξ_i| by Cauchy's inequality.

    Attributes:
        forms: F, (m, n, n).
        constants: g, (m,).
    """

    forms: AnyArray
    constants: AnyArray


def _key(A: AnyArray) -> Any:
    """Return what tells A from other matrices: exact of fractions, rounded of floats."""
    return tuple(A.ravel()) if A.dtype == object else (np.round(A, _DIGITS) + 0.0).tobytes()


def supply(loop: UncertainLoop, sizes: AnyArray) -> Supply:
    """Return the quadratic bounds on ξ; tight where |Y z| is in proportion to `sizes`, positive, (k,)."""
    totals = loop.gains @ sizes + loop.offsets
    weights = loop.gains / sizes
    Y = loop.channels
    forms = [total * (Y.T * row) @ Y for total, row in zip(totals, weights, strict=True)]
    return Supply(np.array(forms).reshape(-1, Y.shape[1], Y.shape[1]), totals * loop.offsets)


def congruent(P: AnyArray, X: AnyArray) -> AnyArray:
    """Return XᵀPX; of fractions over a common denominator, a hundred times as fast as one by one."""
    if P.dtype != object:
        product: AnyArray = X.T @ P @ X
        return product
    (P, below_P), (X, below_X) = whole(P), whole(X)
    below = below_P * below_X * below_X
    fractions: AnyArray = np.vectorize(lambda value: Fraction(value, below), otypes=[object])(X.T @ P @ X)
    return fractions


def whole(matrix: AnyArray) -> tuple[AnyArray, int]:
    """Return a matrix of fractions as integers, and the denominator that all of them have."""
    below = lcm(*(entry.denominator for entry in matrix.ravel()))
    return np.vectorize(lambda entry: int(entry * below), otypes=[object])(matrix), below


def decrease(
    loop: UncertainLoop, A: AnyArray, P: AnyArray, multipliers: AnyArray, forms: AnyArray, ratio: Any, stage: Any = 0
) -> AnyArray:
    """Return the matrix (n + m + d,) * 2 that proves a decrease of V = zᵀPz over a sample where it is not negative.

    That is V[k+1] <= ratio V[k] - zᵀ stage z + Σ_i multipliers_i g_i + that of w, by the S-procedure. It is
    linear in P (n, n) and the multipliers, (m,) and one of w. What all vertices A show their hull does: V is convex.
    """
    n, m = len(P), len(forms)
    moved = np.hstack([A, loop.entries, loop.disturbance])
    M = -congruent(P, moved)
    M[:n, :n] += ratio * P - stage - np.tensordot(multipliers[:m], forms, 1)
    for i in range(n, len(M)):
        M[i, i] += multipliers[min(i - n, m)]
    return M
