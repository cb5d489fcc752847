"""Rows of the table."""

from collections.abc import Callable, Iterator
from enum import StrEnum
from typing import NamedTuple, TypeAlias

from colibri.conformance.subject import Subject


class Result(StrEnum):
    """Result of a trial."""

    OK = "ok"
    FAILED = "failed"
    NOT_APPLICABLE = "not applicable"
    FIGURE = "figure"


class Row(NamedTuple):
    """One trial; `see` is a command, or Python, that shows its failure."""

    area: str
    tried: str
    result: Result
    found: str
    see: str = ""


Check: TypeAlias = Callable[[Subject], Iterator[Row]]
"""Yields the rows of one area."""


def judged(area: str, tried: str, failure: str, found: str, see: str) -> Row:
    if failure:
        return Row(area, tried, Result.FAILED, failure, see)
    return Row(area, tried, Result.OK, found)


def not_applicable(area: str, tried: str, why: str) -> Row:
    return Row(area, tried, Result.NOT_APPLICABLE, why)
