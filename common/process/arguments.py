"""Command lines: one-line errors, and types of arguments."""

import argparse
import re
from argparse import SUPPRESS, ArgumentTypeError
from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any, NoReturn, TypeVar

from colibri.common.errors import unknown
from colibri.common.process.lifecycle import fail

T = TypeVar("T")


class ArgumentParser(argparse.ArgumentParser):
    """A parser with one-line errors and exit code 2; `-33.9,` is a value."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._negative_number_matcher = re.compile(r"^-\.?\d")

    def value(self, name: str, metavar: str, help: str, **more: Any) -> None:
        """Add an argument with a value; unless `help` names the default, it is appended."""
        told = "(default" in help or more.get("default", SUPPRESS) in (SUPPRESS, None, 0, [])
        self.add_argument(name, metavar=metavar, help=help if told else f"{help} (default %(default)s)", **more)

    def several(self, name: str, metavar: str, help: str, usual: str = "", **more: Any) -> None:
        """Add an option that may be repeated; `usual` tells its default, else an empty list."""
        words = f"{help}; may be repeated" + (f" (default: {usual})" if usual else "")
        more = ({} if usual else {"default": []}) | more
        self.add_argument(name, action="append", metavar=metavar, help=words, **more)

    def flag(self, name: str, help: str) -> None:
        self.add_argument(name, action="store_true", help=help)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            raise argparse.ArgumentError(action, unknown("value", value, action.choices))

    def error(self, message: str) -> NoReturn:
        fail(f"{message} (see {self.prog} --help)")


def chosen(kind: str, names: Sequence[str], known: Mapping[str, T], option: str = "") -> list[T]:
    """Return the things of some names, or all; end with an error for an unknown name."""
    for name in names:
        if name not in known:
            fail(f"{option}{unknown(kind, name, known)}")
    return [each for name, each in known.items() if not names or name in names]


def number(text: str) -> float:
    value = float(text)
    if not isfinite(value):
        raise ValueError
    return value


def positive(text: str) -> float:
    value = number(text)
    if value <= 0.0:
        raise ArgumentTypeError(f'must be above zero, not "{text}"')
    return value


def part(text: str) -> float:
    value = positive(text)
    if value > 1.0:
        raise ArgumentTypeError(f"must be a part of 1, not {text}")
    return value


def natural(text: str) -> int:
    value = int(text)
    if value < 0:
        raise ArgumentTypeError(f'must be at least 0, not "{text}"')
    return value


def counting(text: str) -> int:
    value = natural(text)
    if value == 0:
        raise ArgumentTypeError("must be at least 1")
    return value


def seeds(text: str) -> range:
    first, dash, last = text.partition("-")
    try:
        chosen = range(int(first), int(last if dash else first) + 1)
    except ValueError:
        chosen = range(0)
    if not chosen:
        raise ArgumentTypeError(f'must be FIRST-LAST, for example 1-50, not "{text}"')
    return chosen


def keyword(text: str) -> tuple[str, Any]:
    import msgspec

    name, equals, value = text.partition("=")
    if not equals or not name:
        raise ArgumentTypeError(f'must be KEY=VALUE, for example "action=rates", not "{text}"')
    try:
        return name, msgspec.json.decode(value)
    except msgspec.DecodeError:
        return name, value
