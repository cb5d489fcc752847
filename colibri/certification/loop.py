"""A sampled closed loop in a polytope, the subject of every certificate.

    z[k+1] = A z[k] + E ξ[k] + B w[k],   A in the convex hull of the vertices,
    |ξ_i| <= Σ_j N_ij |(Y z)_j| + D_i,   |w| <= 1

A, ξ and w vary arbitrarily. Matrices are float64 for the solver, or `fractions.Fraction` for the exact check.
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
"""Floats or fractions."""
Number: TypeAlias = Callable[[float], Any]
"""`float`, or `fractions.Fraction`."""

_DIGITS = 9  # precision of comparisons of floats


class RangeError(Error):
    """Ranges without bounds of the loop."""


class UncertainLoop(NamedTuple):
    """A closed loop of n states, m rows of ξ and k channels."""

    vertices: AnyArray  # A, (v, n, n)
    entries: AnyArray  # E, (n, m)
    channels: AnyArray  # Y, (k, n)
    gains: AnyArray  # N, (m, k), not negative
    offsets: AnyArray  # D, (m,), not negative
    disturbance: AnyArray  # b, (n, d)
    limits: AnyArray  # rows f, (l, n): |f z| <= 1
    starts: AnyArray  # desired starts, (s, n), each along one axis
    stage: AnyArray  # stage cost, (n, n)
    mirrors: Array  # signs of states, (g, n), that map the polytope to itself

    def blocks(self) -> list[list[int]]:
        """Return groups of states to couple in P, by mirror images."""
        found: dict[tuple[float, ...], list[int]] = {}
        for state, signs in enumerate(self.mirrors.T.tolist()):
            found.setdefault(tuple(signs), []).append(state)
        return list(found.values())

    def distinct(self) -> "UncertainLoop":
        signs = np.unique(np.vstack([np.ones_like(self.mirrors[:1]), self.mirrors, self.mirrors.prod(axis=0)]), axis=0)
        kept: dict[Any, int] = {}
        for i, A in enumerate(self.vertices):
            if not any(_key(row[:, None] * A * row) in kept for row in signs):
                kept[_key(A)] = i
        return self._replace(vertices=self.vertices[list(kept.values())])

    def undisturbed(self) -> "UncertainLoop":
        return self._replace(offsets=0 * self.offsets, disturbance=self.disturbance[:, :0]).reduced()

    def reduced(self) -> "UncertainLoop":
        rows, columns = (self.gains != 0).any(axis=1) | (self.offsets != 0), (self.gains != 0).any(axis=0)
        return self._replace(
            entries=self.entries[:, rows],
            channels=self.channels[columns],
            gains=self.gains[np.ix_(rows, columns)],
            offsets=self.offsets[rows],
        )


class Supply(NamedTuple):
    """ξ_i² <= zᵀ F_i z + g_i, with F, (m, n, n), and g, (m,), by Cauchy's inequality."""

    forms: AnyArray
    constants: AnyArray


def _key(A: AnyArray) -> Any:
    return tuple(A.ravel()) if A.dtype == object else (np.round(A, _DIGITS) + 0.0).tobytes()


def supply(loop: UncertainLoop, sizes: AnyArray) -> Supply:
    """Return the quadratic bounds on ξ, tight for |Y z| in proportion to `sizes`, (k,)."""
    totals = loop.gains @ sizes + loop.offsets
    weights = loop.gains / sizes
    Y = loop.channels
    forms = [total * (Y.T * row) @ Y for total, row in zip(totals, weights, strict=True)]
    return Supply(np.array(forms).reshape(-1, Y.shape[1], Y.shape[1]), totals * loop.offsets)


def congruent(P: AnyArray, X: AnyArray) -> AnyArray:
    """Return XᵀPX; fractions are faster over a common denominator."""
    if P.dtype != object:
        return X.T @ P @ X
    (P, below_P), (X, below_X) = whole(P), whole(X)
    below = below_P * below_X * below_X
    fractions: AnyArray = np.vectorize(lambda value: Fraction(value, below), otypes=[object])(X.T @ P @ X)
    return fractions


def whole(matrix: AnyArray) -> tuple[AnyArray, int]:
    """Return integers and the common denominator."""
    below = lcm(*(entry.denominator for entry in matrix.ravel()))
    return np.vectorize(lambda entry: int(entry * below), otypes=[object])(matrix), below


def decrease(
    loop: UncertainLoop, A: AnyArray, P: AnyArray, multipliers: AnyArray, forms: AnyArray, ratio: Any, stage: Any = 0
) -> AnyArray:
    """Return a matrix whose positive semidefiniteness proves a decrease of V = zᵀPz (S-procedure).

    V[k+1] <= ratio V[k] - zᵀ stage z + Σ_i multipliers_i g_i + that of w; linear in P and the multipliers. V is
    convex, so vertices prove it for their hull.
    """
    n, m = len(P), len(forms)
    moved = np.hstack([A, loop.entries, loop.disturbance])
    M = -congruent(P, moved)
    M[:n, :n] += ratio * P - stage - np.tensordot(multipliers[:m], forms, 1)
    for i in range(n, len(M)):
        M[i, i] += multipliers[min(i - n, m)]
    return M
