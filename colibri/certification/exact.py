"""Exact check of a certificate from its numbers alone.

From the solver only P and the multipliers are used, as written decimals: the loop is rebuilt in fractions.
"""

from fractions import Fraction
from typing import Any

import numpy as np

from colibri.certification.loop import AnyArray, UncertainLoop, decrease, supply, whole
from colibri.certification.lyapunov import Proof
from colibri.common.types import Array

_ONE = np.array([Fraction(1)], dtype=object)
_BITS = 40
"""Precision of a factor's entries."""


def exactly(value: float) -> Fraction:
    """Return the number as written, 0.1 as a tenth."""
    return Fraction(repr(float(value)))


def decrease_margin(loop: UncertainLoop, proof: Proof, *, weighted: bool = False) -> float:
    """Return the least margin of the decrease over all vertices; 0 without proof."""
    P, multipliers = _fractions(proof.P), _fractions(proof.multipliers)
    forms = supply(loop, _fractions(proof.sizes)).forms
    if (multipliers <= 0).any() or (_fractions(proof.sizes) <= 0).any() or not _mirrored(loop, P, multipliers, forms):
        return 0.0
    ratio, stage = exactly(proof.ratio), loop.stage if weighted else 0
    matrices = (decrease(loop, A, P, multipliers, forms, ratio, stage) for A in loop.distinct().vertices)
    return min([positive_margin(P), *map(positive_margin, matrices)])


def limit_margin(loop: UncertainLoop, proof: Proof) -> float:
    """Return the least margin of the limits over the set V <= 1."""
    P = _fractions(proof.P)
    bordered = (np.vstack([np.column_stack([P, row]), np.append(row, _ONE)]) for row in loop.limits)
    return min(map(positive_margin, bordered))


def supply_margin(loop: UncertainLoop, proof: Proof) -> float:
    """Return the decrease at V = 1 minus the largest increase by a disturbance."""
    constants = np.append(supply(loop, _fractions(proof.sizes)).constants, _ONE)
    return float(1 - exactly(proof.ratio) - _fractions(proof.multipliers) @ constants)


def positive_margin(M: AnyArray) -> float:
    """Return a proven μ with M - μ diag(M) positive definite; 0 without proof."""
    diagonal = np.diag(M).astype(float)
    if (diagonal <= 0.0).any():
        return 0.0
    least = np.linalg.eigvalsh(M.astype(float) / np.sqrt(np.outer(diagonal, diagonal)))[0]
    margin = 0.5 * float(least)
    return margin if margin > 0.0 and is_positive(M - np.diag(np.diag(M) * Fraction(margin))) else 0.0


def is_positive(M: AnyArray) -> bool:
    """Prove that M is symmetric and positive definite.

    With X an approximate inverse factor, X M Xᵀ must be strictly diagonally dominant, in integers (Gershgorin).
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


def _mirrored(loop: UncertainLoop, P: AnyArray, multipliers: AnyArray, forms: AnyArray) -> bool:
    """Whether the mirrors map the loop to itself; the inequality contains E and μ only as E diag(1 / μ) Eᵀ."""
    entered = loop.entries / multipliers[: len(forms)] @ loop.entries.T
    return all(
        (row[:, None] * matrix * row == matrix).all()
        for row in loop.mirrors
        for matrix in (P, *forms, loop.disturbance @ loop.disturbance.T, entered, loop.stage)
    )


def _fractions(values: Array) -> Any:
    return np.vectorize(exactly, otypes=[object])(values)
