"""The certificate of a law: Lyapunov functions found, each checked in exact arithmetic, written down and read again."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import msgspec
import numpy as np

from colibri.certification import exact, lyapunov
from colibri.certification.loop import Number, RangeError, UncertainLoop
from colibri.certification.lyapunov import Proof
from colibri.common.errors import Error

_WORKING_PART = 0.5
"""Of the largest scale: the nearer to it, the slower the decay and the smaller the set."""
_DIGITS = 4


class RefusedError(Error):
    """A law of which what is to be proven was not proven."""


class CertifiedLaw(Protocol):
    """A law that can be certified, by the closed loops of its model and gain over any part of its ranges."""

    def numbers_at(self, scale: float) -> Any:
        """Return a named tuple of the numbers of the loop whose ranges are this part of the profile's."""

    def loop(self, numbers: Any, number: Number) -> UncertainLoop:
        """Return the loop of these numbers, in floats or in fractions.

        Raises:
            RangeError: It cannot be bounded.
        """


class Entry(NamedTuple):
    """One proof, and all that it is about.

    Attributes:
        scale: Of the profile's ranges.
        numbers: Of the loop at that scale.
        proof: The Lyapunov function.
        margins: What its exact check found, by the name of what was checked.
    """

    scale: float
    numbers: Any
    proof: Proof
    margins: dict[str, float]


class Certificate(NamedTuple):
    """What is proven.

    Attributes:
        largest: At the largest scale that has a common quadratic Lyapunov function.
        decay: At half of that: the one that falls fastest.
        invariant: The largest set that the disturbance does not make the loop leave, within all limits.
        attractor: The smallest that all that begins there tends to.
        terminal: A terminal weight, with which and the set a plan stays feasible and its cost falls.
    """

    largest: Entry
    decay: Entry
    invariant: Entry
    attractor: Entry
    terminal: Entry


def certify(law: CertifiedLaw, least: float, say: Callable[[str], None]) -> Certificate:
    """Return the certificate of a law, every part of it checked.

    Args:
        law: The law.
        least: Scale of the ranges for which there must be a Lyapunov function, at the least.
        say: Is told what is being done.

    Raises:
        RefusedError: Something is not proven.
    """
    say("the largest ranges")
    found = lyapunov.largest_scale(lambda scale: _loop_at(law, scale), least)
    if found is None:
        raise RefusedError(f"no Lyapunov function for {least:g} of the ranges: {_why(law, least)}")
    scale = round(_WORKING_PART * found[0], _DIGITS)
    try:
        loop = law.loop(law.numbers_at(scale), float)
    except RangeError as error:
        raise RefusedError(f"no set within {scale:g} of the ranges: {error}") from None
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
            raise RefusedError(f"{what}: there is none within {scale:g} of the ranges, against this disturbance")
        proofs[name] = (scale, proof)
    say("exact arithmetic")
    return Certificate(**{name: _checked(law, name, *each) for name, each in proofs.items()})


def margins_of(law: CertifiedLaw, name: str, numbers: Any, proof: Proof) -> dict[str, float]:
    """Return what the exact check of the entry `name` finds: all above zero where it is proven."""
    loop = law.loop(numbers, exact.exactly)
    if name in ("largest", "decay", "terminal"):
        return {"decrease": exact.decrease_margin(loop.undisturbed(), proof, weighted=name == "terminal")}
    margins = {"decrease": exact.decrease_margin(loop, proof), "disturbance": exact.supply_margin(loop, proof)}
    return margins | ({"limits": exact.limit_margin(loop, proof)} if name == "invariant" else {})


def write(certificate: Certificate, about: dict[str, Any], path: Path) -> None:
    """Write a certificate as JSON, with what it is about: law, conditions, and what it does not prove."""
    entries = {"about": about} | {
        name: entry._asdict() | {"numbers": entry.numbers._asdict(), "proof": entry.proof._asdict()}
        for name, entry in certificate._asdict().items()
    }
    path.write_bytes(msgspec.json.format(msgspec.json.encode(entries, enc_hook=lambda array: array.tolist()), indent=1))


def read(path: Path, numbers: Callable[..., Any]) -> Certificate:
    """Read a certificate as `write` wrote it; `numbers` is the law's named tuple."""
    entries: dict[str, dict[str, Any]] = msgspec.json.decode(path.read_bytes())
    return Certificate(**{name: _entry(numbers, **entries[name]) for name in Certificate._fields})


def _entry(
    kind: Callable[..., Any], scale: float, numbers: dict[str, Any], proof: dict[str, Any], margins: dict[str, float]
) -> Entry:
    P, multipliers, sizes = (np.array(proof[name]) for name in ("P", "multipliers", "sizes"))
    return Entry(scale, kind(**numbers), Proof(P, multipliers, sizes, proof["ratio"]), margins)


def _checked(law: CertifiedLaw, name: str, scale: float, proof: Proof) -> Entry:
    numbers = law.numbers_at(scale)
    margins = margins_of(law, name, numbers, proof)
    failed = [what for what, margin in margins.items() if not margin > 0.0]
    if failed:
        raise RefusedError(f"{name}: found, but exact arithmetic does not confirm {' and '.join(failed)}")
    return Entry(scale, numbers, proof, margins)


def _loop_at(law: CertifiedLaw, scale: float) -> UncertainLoop | None:
    try:
        return law.loop(law.numbers_at(scale), float)
    except RangeError:
        return None


def _why(law: CertifiedLaw, scale: float) -> str:
    """Return why there is no Lyapunov function: a vertex that is unstable by itself, or that none was found."""
    try:
        radius = lyapunov.spectral_radius(law.loop(law.numbers_at(scale), float))
    except RangeError as error:
        return str(error)
    if radius >= 1.0:
        return f"a vertex is unstable by itself, with a spectral radius of {radius:.4f}"
    return "none is found, though every vertex is stable by itself"
