"""Semidefinite programs by Clarabel: a linear objective under linear matrix inequalities."""

from collections.abc import Sequence
from typing import NamedTuple

import clarabel
import numpy as np
from scipy import sparse

from colibri.common.types import Array

_MAX_ROUNDS = 40
_ADDED = 5
_ENOUGH = 5e-8
"""Tolerance of an inequality's least eigenvalue: less than the margin of `lyapunov`."""
_USABLE = ("Solved", "AlmostSolved", "InsufficientProgress")
"""Statuses that may come with a solution; a check decides."""


class Inequality(NamedTuple):
    """constant + Σ_i x_i coefficients_i is positive semidefinite."""

    constant: Array
    coefficients: Array


def minimise(cost: Array, always: Sequence[Inequality], many: Inequality | None = None) -> Array | None:
    """Return the x of least cost under all inequalities; `None` if Clarabel finds no solution.

    `many` is a stack of inequalities of one size, added as they are violated: few of them bind.
    """
    total = 0 if many is None else len(many.constant)
    taken = list(range(0, total, max(1, total // _ADDED)))
    for _ in range(_MAX_ROUNDS):
        chosen = [] if many is None else [Inequality(many.constant[i], many.coefficients[i]) for i in taken]
        x = _solve(cost, [*always, *chosen])
        if x is None or many is None:
            return x
        least = np.linalg.eigvalsh(many.constant + np.tensordot(many.coefficients, x, (1, 0)))[:, 0]
        violated = [int(i) for i in np.argsort(least) if least[i] < -_ENOUGH and int(i) not in taken]
        if not violated:
            return x
        taken += violated[:_ADDED]
    return None


def _solve(cost: Array, inequalities: Sequence[Inequality]) -> Array | None:
    rows = sparse.csc_matrix(np.vstack([-_vectors(item.coefficients).T for item in inequalities]))
    constants = np.concatenate([_vectors(item.constant) for item in inequalities])
    cones = [clarabel.PSDTriangleConeT(item.constant.shape[-1]) for item in inequalities]
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.max_threads = False, 1
    # The problems are scaled well, and dense: with either of these Clarabel gave up on feasible ones.
    settings.equilibrate_enable, settings.chordal_decomposition_enable = False, False
    size = len(cost)
    nothing = sparse.csc_matrix((size, size))
    solution = clarabel.DefaultSolver(nothing, cost, rows, constants, cones, settings).solve()
    return np.array(solution.x) if str(solution.status) in _USABLE else None


def _vectors(matrices: Array) -> Array:
    """Return the upper triangles of (..., k, k), column by column, off-diagonals times √2."""
    columns, rows = np.tril_indices(matrices.shape[-1])
    vectors: Array = matrices[..., rows, columns] * np.where(rows == columns, 1.0, np.sqrt(2.0))
    return vectors
