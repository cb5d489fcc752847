"""The marks of flight tests: their arguments, and what is wrong with one."""

from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from typing import Any, NamedTuple

import pytest

from colibri.common.errors import unknown

ALIKE = 0.75
"""Similarity from which an unknown mark is taken for a typo."""


class Signature(NamedTuple):
    """The arguments of a mark, each with the option of `Setting` that it sets; `needed` of them are required."""

    options: Mapping[str, str]
    needed: int = 1
    meaning: str = ""  # default: of the first option

    @property
    def arguments(self) -> str:
        names = list(self.options)
        return ", ".join([*names[: self.needed], *(f"{name}=None" for name in names[self.needed :])])


MARKS = {
    "sitl": Signature({}, 0, "initial conditions by name, options of `colibri.sitl.Setting`"),
    "vehicle": Signature({"name": "vehicle"}),
    "feedback": Signature({"kind": "feedback"}),
    "wind": Signature({"wind": "wind", "turbulence": "turbulence"}),
    "seed": Signature({"number": "seed"}),
    "seeds": Signature({"first": "seed", "last": "seed"}, 2, "one flight for each seed"),
}


def signature(name: str) -> str:
    return f"{name}({MARKS[name].arguments or 'NAME=VALUE, ...'})"


def described(name: str) -> str:
    """Return a mark's signature and meaning, by the options of a flight's setting."""
    from colibri.common.spec import fields_of
    from colibri.sitl.backends.setting import Setting

    known, mark = fields_of(Setting), MARKS[name]
    meaning = mark.meaning or known[next(iter(mark.options.values()))].option.help
    return f"{signature(name)}: {meaning}" if mark.options else f"{signature(name)}: {meaning}: {', '.join(known)}"


def setting_values(mark: pytest.Mark) -> dict[str, Any]:
    options = MARKS[mark.name].options
    return {options.get(name, name): value for name, value in arguments(mark).items()}


def arguments(mark: pytest.Mark, of: str = "") -> dict[str, Any]:
    """Return the arguments of a mark by name; a failure begins with `of`."""
    known = MARKS[mark.name]
    names = list(known.options)
    typo = next((name for name in mark.kwargs if name not in names), None) if names else None
    if typo is not None:
        pytest.fail(f"{of}mark {mark.name}: {unknown('argument', typo, names)}", pytrace=False)
    values = {**dict(zip(names, mark.args, strict=False)), **mark.kwargs}
    if len(mark.args) > len(names) or not set(names[: known.needed]) <= set(values):
        pytest.fail(f"{of}mark is {signature(mark.name)}, not {written(mark)}", pytrace=False)
    return values


def written(mark: pytest.Mark) -> str:
    return f"{mark.name}({', '.join([*map(repr, mark.args), *(f'{k}={v!r}' for k, v in mark.kwargs.items())])})"


def without_effect(item: pytest.Item, fixtures: Iterable[str], registered: list[str]) -> str | None:
    """Return what is wrong with a test's marks: one without its fixture, or a typo."""
    used = set(fixtures)
    if used & {"sitl", "sitl_fleet"}:
        return next(filter(None, (_typo(mark, registered) for mark in item.iter_markers())), None)
    for mark in item.own_markers:
        of_others = registered.count(mark.name) > 1
        if mark.name in MARKS and not of_others and ("request" not in used or mark.name == "seeds"):
            return f"mark {mark.name} has no effect: {item.name} uses neither fixture sitl nor sitl_fleet"
    return None


def _typo(mark: pytest.Mark, registered: list[str]) -> str | None:
    """Return what an unregistered mark with arguments was meant to be."""
    if mark.name in registered or not (mark.args or mark.kwargs):
        return None
    from colibri.common.spec import fields_of
    from colibri.sitl.backends.setting import Setting

    if get_close_matches(mark.name, MARKS, 1, ALIKE):
        return unknown("mark", mark.name, MARKS)
    option = next(iter(get_close_matches(mark.name, fields_of(Setting), 1, ALIKE)), None)
    return option and f'unknown mark "{mark.name}" (did you mean "sitl({option}=...)"?)'
