"""The proofs of a certificate, checked in exact arithmetic, from its numbers alone.

Nothing of what the solver computed is trusted but P and the multipliers, as the decimal numbers that are written down:
the loop is built again from its numbers in fractions, with every vertex, and each inequality decided in fractions.
"""

from collections.abc import Iterable
from fractions import Fraction
from typing import Any

import numpy as np

from colibri.certification.loop import AnyArray, UncertainLoop, decrease, supply, whole
from colibri.certification.lyapunov import Proof
from colibri.common.types import Array

_ONE = np.array([Fraction(1)], dtype=object)
_BITS = 40
"""Of the entries of a factor."""


def exactly(value: float) -> Fraction:
    """Return the number that is written as `value` is, 0.1 as a tenth."""
    return Fraction(repr(float(value)))


def decrease_margin(loop: UncertainLoop, proof: Proof, *, weighted: bool = False) -> float:
    """Return the least margin of all the decreases that a proof claims, at every vertex; 0 where one is not shown.

    Args:
        loop: Of fractions.
        proof: Its P, multipliers and sizes.
        weighted: V falls by the stage's cost, too.
    """
    P, multipliers = _fractions(proof.P), _fractions(proof.multipliers)
    forms = supply(loop, _fractions(proof.sizes)).forms
    if (multipliers <= 0).any() or (_fractions(proof.sizes) <= 0).any() or not _mirrored(loop, P, multipliers, forms):
        return 0.0
    ratio, stage = exactly(proof.ratio), loop.stage if weighted else 0
    matrices = (decrease(loop, A, P, multipliers, forms, ratio, stage) for A in loop.distinct().vertices)
    return min([positive_margin(P), *_margins(matrices)])


def limit_margin(loop: UncertainLoop, proof: Proof) -> float:
    """Return the least margin by which the set V <= 1 keeps the loop's limits; 0 where one is not shown to be kept."""
    P = _fractions(proof.P)

    def bordered(row: AnyArray) -> AnyArray:
        return np.vstack([np.column_stack([P, row]), np.append(row, _ONE)])

    return min(_margins(map(bordered, loop.limits)))


def supply_margin(loop: UncertainLoop, proof: Proof) -> float:
    """Return what the decrease at V = 1 leaves of itself after all that a disturbance adds; negative: it adds more."""
    multipliers = _fractions(proof.multipliers)
    constants = np.append(supply(loop, _fractions(proof.sizes)).constants, _ONE)
    added = multipliers @ constants
    return float(1 - exactly(proof.ratio) - added)


def positive_margin(M: AnyArray) -> float:
    """Return a μ for which M - μ diag(M) is shown to be positive definite, about half of the largest; 0 without one."""
    diagonal = np.diag(M).astype(float)
    if (diagonal <= 0.0).any():
        return 0.0
    least = np.linalg.eigvalsh(M.astype(float) / np.sqrt(np.outer(diagonal, diagonal)))[0]
    margin = 0.5 * float(least)
    return margin if margin > 0.0 and is_positive(M - np.diag(np.diag(M) * Fraction(margin))) else 0.0


def is_positive(M: AnyArray) -> bool:
    """Return whether M is shown to be symmetric and positive definite.

    With X, what floating point has for the inverse of its Cholesky factor, X M Xᵀ is about the identity. Where it is
    strictly diagonally dominant, which integers decide, it is positive definite (Gershgorin), X is regular; so is M.
    """
    if not (M == M.T).all():
        return False
    try:
        factor = np.linalg.inv(np.linalg.cholesky(M.astype(float)))
    except np.linalg.LinAlgError:
        return False
    shift = _BITS - np.frexp(np.abs(factor).max(axis=1))[1]
    X = np.vectorize(int, otypes=[object])(np.ldexp(factor, shift[:, None]))
    product = X @ whole(M)[0] @ X.T
    weights = np.array([1 << int(shift.max() - each) for each in shift], dtype=object)
    diagonal = np.diag(product)
    return bool((abs(product) @ weights < 2 * diagonal * weights).all())


def _margins(matrices: Iterable[AnyArray]) -> Iterable[float]:
    return map(positive_margin, matrices)


def _mirrored(loop: UncertainLoop, P: AnyArray, multipliers: AnyArray, forms: AnyArray) -> bool:
    """Return whether the mirrors leave all as it is, so that distinct vertices are enough.

    By a Schur complement the inequality depends on E and the multipliers μ of ξ only by E diag(1 / μ) Eᵀ.
    """
    entered = loop.entries / multipliers[: len(forms)] @ loop.entries.T
    return all(
        (row[:, None] * matrix * row == matrix).all()
        for row in loop.mirrors
        for matrix in (P, *forms, loop.disturbance @ loop.disturbance.T, entered, loop.stage)
    )


def _fractions(values: Array) -> Any:
    return np.vectorize(exactly, otypes=[object])(values)
