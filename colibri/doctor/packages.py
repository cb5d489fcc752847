"""Check Python and the installed packages against requirements and lock."""

import platform
import re
import sys
from collections.abc import Iterable, Iterator
from importlib.metadata import PackageNotFoundError, distribution, version
from pathlib import Path

from packaging.requirements import Requirement

import colibri
from colibri.doctor.finding import Finding, Severity

PACKAGE = "colibri-sitl"
FOR_DEVELOPERS = ("bench", "clients", "dev")
"""Extras that flights do not require."""
_LOCK = "requirements.lock"
_PINNED = re.compile(r"^[\w.-]+==[^\\\n]+", re.MULTILINE)
_SHOWN = 3


def python() -> Finding:
    return Finding("Python", Severity.FINE, f"{platform.python_version()}, {sys.executable}")


def packages() -> Finding:
    wrong = [words for asked in _asked() if (words := _wrong(asked))]
    if wrong:
        return Finding("packages", Severity.FAILED, ", ".join(wrong), f"pip install --upgrade {PACKAGE}")
    return Finding("packages", Severity.FINE, f"{PACKAGE} {version(PACKAGE)} and the {len(_asked())} that it needs")


def lock() -> Finding | None:
    """Compare versions with the lock, which exists only in a checkout."""
    path = Path(colibri.__file__).resolve().parents[1] / _LOCK
    if not path.is_file():
        return None
    pinned = _here(map(Requirement, _PINNED.findall(path.read_text(encoding="utf-8"))))
    others = [words for pin in pinned if version_of(pin.name) is not None and (words := _wrong(pin))]
    if others:
        more = f" and {len(others) - _SHOWN} more" if len(others) > _SHOWN else ""
        return Finding(
            "lock", Severity.NOTE, ", ".join(others[:_SHOWN]) + more, "make clean setup: as they were tested"
        )
    return Finding("lock", Severity.FINE, f"no other version than {_LOCK} names")


def extras() -> Iterator[Finding]:
    for extra in distribution(PACKAGE).metadata.get_all("Provides-Extra") or []:
        if extra in FOR_DEVELOPERS:
            continue
        missing = [asked.name for asked in _asked(extra) if _wrong(asked)]
        if missing:
            advice = f"if you need it: pip install '{PACKAGE}[{extra}]'"
            yield Finding(f"extra {extra}", Severity.NOTE, f"without {', '.join(missing)}", advice)
        else:
            yield Finding(f"extra {extra}", Severity.FINE, "installed")


def _asked(extra: str = "") -> list[Requirement]:
    every = [Requirement(line) for line in distribution(PACKAGE).requires or []]
    always = _here(every)
    return [asked for asked in _here(every, extra) if asked not in always] if extra else always


def _here(every: Iterable[Requirement], extra: str = "") -> list[Requirement]:
    return [asked for asked in every if asked.marker is None or asked.marker.evaluate({"extra": extra})]


def _wrong(asked: Requirement) -> str:
    has = version_of(asked.name)
    if has is None:
        return f"{asked.name} is missing"
    return "" if asked.specifier.contains(has, prereleases=True) else f"{asked.name} is {has}, not {asked.specifier}"


def version_of(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
