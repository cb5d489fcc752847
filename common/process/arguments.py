"""The command line: errors of one line, and the numbers that options take."""

import argparse
import re
from argparse import ArgumentTypeError
from math import isfinite
from typing import Any, NoReturn

from colibri.common.process.lifecycle import fail


class ArgumentParser(argparse.ArgumentParser):
    """A parser whose errors are one line and exit code 2, and to which what begins like `-33.9,` is a value."""

    def __init__(self, *args: Any, **options: Any) -> None:
        """Take what argparse takes."""
        super().__init__(*args, **options)
        self._negative_number_matcher = re.compile(r"^-\.?\d")

    def error(self, message: str) -> NoReturn:
        """Say what is wrong and where to read on."""
        fail(f"{message} (see {self.prog} --help)")


def number(text: str) -> float:
    """Read a finite number of the command line."""
    value = float(text)
    if not isfinite(value):
        raise ValueError
    return value


def positive(text: str) -> float:
    """Read a number above zero of the command line."""
    value = number(text)
    if value <= 0.0:
        raise ArgumentTypeError(f"must be above zero, not {text}")
    return value


def natural(text: str) -> int:
    """Read a whole number from 0 on of the command line."""
    value = int(text)
    if value < 0:
        raise ArgumentTypeError(f"must not be below zero, not {text}")
    return value


def seeds(text: str) -> range:
    """Read FIRST-LAST, or one seed, of the command line."""
    first, dash, last = text.partition("-")
    try:
        chosen = range(int(first), int(last if dash else first) + 1)
    except ValueError:
        chosen = range(0)
    if not chosen:
        raise ArgumentTypeError(f"expected FIRST-LAST, 1-50 say, not {text}")
    return chosen
