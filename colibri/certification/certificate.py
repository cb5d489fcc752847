"""Certificate of a law: Lyapunov functions, rebuilt in fractions from written decimals and checked exactly."""

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from colibri.certification import lyapunov
from colibri.certification.attitude import AttitudeNumbers, attitude_loop
from colibri.certification.loop import AnyArray, RangeError, UncertainLoop, decrease, supply, whole
from colibri.certification.lyapunov import Proof
from colibri.common.errors import Error
from colibri.common.types import Array

_ONE = np.array([Fraction(1)], dtype=object)
_BITS = 40  # precision of a factor's entries


def exactly(value: float) -> Fraction:
    """Return the number as written, 0.1 as a tenth."""
    return Fraction(repr(float(value)))


def decrease_margin(loop: UncertainLoop, proof: Proof, *, weighted: bool = False) -> float:
    """Return the least margin over the vertices; 0 without proof."""
    P, multipliers = _fractions(proof.P), _fractions(proof.multipliers)
    forms = supply(loop, _fractions(proof.sizes)).forms
    if (multipliers <= 0).any() or (_fractions(proof.sizes) <= 0).any() or not _mirrored(loop, P, multipliers, forms):
        return 0.0
    ratio, stage = exactly(proof.ratio), loop.stage if weighted else 0
    margin = positive_margin(P)
    for A in loop.distinct().vertices:
        margin = margin and min(margin, positive_margin(decrease(loop, A, P, multipliers, forms, ratio, stage)))
    return margin


def limit_margin(loop: UncertainLoop, proof: Proof) -> float:
    """Return the least margin of the limits over V <= 1."""
    P = _fractions(proof.P)
    bordered = (np.vstack([np.column_stack([P, row]), np.append(row, _ONE)]) for row in loop.limits)
    return min(map(positive_margin, bordered))


def supply_margin(loop: UncertainLoop, proof: Proof) -> float:
    """Return the decrease at V = 1 minus the largest increase by a disturbance."""
    constants = np.append(supply(loop, _fractions(proof.sizes)).constants, _ONE)
    return float(1 - exactly(proof.ratio) - _fractions(proof.multipliers) @ constants)


def positive_margin(M: AnyArray) -> float:
    """Return a proven μ with M - μ diag(M) positive definite, else 0."""
    diagonal = np.diag(M).astype(float)
    if (diagonal <= 0.0).any():
        return 0.0
    least = np.linalg.eigvalsh(M.astype(float) / np.sqrt(np.outer(diagonal, diagonal)))[0]
    margin = 0.5 * float(least)
    return margin if margin > 0.0 and is_positive(M - np.diag(np.diag(M) * Fraction(margin))) else 0.0


def is_positive(M: AnyArray) -> bool:
    """Prove M positive definite: with X near an inverse factor, X M Xᵀ is strictly diagonally dominant (Gershgorin)."""
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
    """Whether the mirrors map the loop to itself; E and μ count as E diag(1 / μ) Eᵀ."""
    entered = loop.entries / multipliers[: len(forms)] @ loop.entries.T
    return all(
        (row[:, None] * matrix * row == matrix).all()
        for row in loop.mirrors
        for matrix in (P, *forms, loop.disturbance @ loop.disturbance.T, entered, loop.stage)
    )


def _fractions(values: Array) -> Any:
    return np.vectorize(exactly, otypes=[object])(values)


_WORKING_PART = 0.5  # part of the largest scale; near it decay is slow
_DIGITS = 4


class NotCertifiedError(Error):
    """A law without proof."""


class ProofEntry(NamedTuple):
    """A proof at a scale, with the loop's numbers and the margins."""

    scale: float
    numbers: AttitudeNumbers
    proof: Proof
    margins: dict[str, float]


class Certificate(NamedTuple):
    """Proofs for the largest ranges, and at half of their scale."""

    largest: ProofEntry
    decay: ProofEntry
    invariant: ProofEntry  # the largest set that the disturbed loop never leaves, within the limits
    attractor: ProofEntry  # the smallest set that every trajectory tends to
    terminal: ProofEntry  # a terminal weight that keeps plans feasible and decreases their cost


def certify(numbers_at: Callable[[float], AttitudeNumbers], least: float, say: Callable[[str], None]) -> Certificate:
    """Certify a law, by its numbers at a scale, down to `least`; `NotCertifiedError` if a part is not proven."""

    def loop_at(scale: float) -> UncertainLoop:
        return attitude_loop(numbers_at(scale), float)

    say("the largest ranges")
    found = lyapunov.largest_scale(loop_at, least)
    if found is None:
        raise NotCertifiedError(f"no Lyapunov function for {least:g} of the ranges: {_why(loop_at, least)}")
    scale = round(_WORKING_PART * found[0], _DIGITS)
    try:
        loop = loop_at(scale)
    except RangeError as error:
        raise NotCertifiedError(f"no set within {scale:g} of the ranges: {error}") from None
    proofs = {"largest": found}
    for name, what, finder in (
        ("decay", "the fastest decay", lyapunov.fastest),
        ("invariant", "the invariant set", lyapunov.invariant_set),
        ("attractor", "what it tends to", lyapunov.attractor),
        ("terminal", "the terminal weight", lyapunov.terminal_weight),
    ):
        say(what)
        proof = finder(loop)
        if proof is None:
            raise NotCertifiedError(f"{what}: there is none within {scale:g} of the ranges, against this disturbance")
        proofs[name] = (scale, proof)
    say("exact arithmetic")
    return Certificate(**{name: _checked(name, at, numbers_at(at), proof) for name, (at, proof) in proofs.items()})


def margins_of(name: str, numbers: AttitudeNumbers, proof: Proof) -> dict[str, float]:
    """Return the margins of the exact check, positive in a proof."""
    loop = attitude_loop(numbers, exactly)
    if name in ("largest", "decay", "terminal"):
        return {"decrease": decrease_margin(loop.undisturbed(), proof, weighted=name == "terminal")}
    margins = {"decrease": decrease_margin(loop, proof), "disturbance": supply_margin(loop, proof)}
    return margins | ({"limits": limit_margin(loop, proof)} if name == "invariant" else {})


def write(certificate: Certificate, about: dict[str, Any], path: Path) -> None:
    entries = {"about": about} | {
        name: entry._asdict() | {"numbers": entry.numbers._asdict(), "proof": entry.proof._asdict()}
        for name, entry in certificate._asdict().items()
    }
    path.write_bytes(msgspec.json.format(msgspec.json.encode(entries, enc_hook=lambda array: array.tolist()), indent=1))


def _checked(name: str, scale: float, numbers: AttitudeNumbers, proof: Proof) -> ProofEntry:
    margins = margins_of(name, numbers, proof)
    failed = [what for what, margin in margins.items() if not margin > 0.0]
    if failed:
        raise NotCertifiedError(f"{name}: found, but exact arithmetic does not confirm {' and '.join(failed)}")
    return ProofEntry(scale, numbers, proof, margins)


def _why(loop_at: Callable[[float], UncertainLoop], scale: float) -> str:
    try:
        radius = lyapunov.spectral_radius(loop_at(scale))
    except RangeError as error:
        return str(error)
    if radius >= 1.0:
        return f"a vertex is unstable by itself, with a spectral radius of {radius:.4f}"
    return "none is found, though every vertex is stable by itself"
