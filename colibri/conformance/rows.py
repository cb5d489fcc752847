"""Rows of the table: what was tried, what came of it, and how to see a failure."""

from collections.abc import Callable, Iterator
from enum import StrEnum
from typing import NamedTuple, TypeAlias

from colibri.conformance.subject import Subject


class Result(StrEnum):
    """What came of a trial."""

    OK = "ok"
    FAILED = "failed"
    NOT_APPLICABLE = "not applicable"
    FIGURE = "figure"


class Row(NamedTuple):
    """One trial.

    Attributes:
        area: What it belongs to: interface, memory, limits, optional, time, flights, restart.
        tried: What was tried.
        result: What came of it; a figure is no verdict.
        found: The numbers, or what went wrong.
        see: A command, or Python, that shows the failure; empty where nothing failed.
    """

    area: str
    tried: str
    result: Result
    found: str
    see: str = ""


Check: TypeAlias = Callable[[Subject], Iterator[Row]]
"""Yields the rows of one area."""


def judged(area: str, tried: str, failure: str, found: str, see: str) -> Row:
    """Return the row of a trial that failed if there is a `failure`, and else has `found` something."""
    if failure:
        return Row(area, tried, Result.FAILED, failure, see)
    return Row(area, tried, Result.OK, found)


def not_applicable(area: str, tried: str, why: str) -> Row:
    """Return the row of a trial that this law, or this vehicle, has nothing for."""
    return Row(area, tried, Result.NOT_APPLICABLE, why)
