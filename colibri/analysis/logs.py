"""The logs of a flight, read in blocks: what that takes in memory does not grow with the flight."""

from array import array
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from colibri.common.types import Array

BLOCK_BYTES = 1 << 18
"""Of text: some seconds of a flight."""
_AT_ONCE = 4096


def read_columns(path: Path) -> list[str]:
    """Return the names of a log's columns."""
    with path.open(encoding="utf-8") as log:
        return log.readline().rstrip("\n").split(",")


def read_blocks(path: Path, wanted: NDArray[np.bool_] | None = None) -> Iterator[Array]:
    """Yield the rows of a log in their order, in blocks (k, columns) of at least one.

    Args:
        path: The log. Only complete rows count: a process that was killed may leave half of one.
        wanted: Which of the rows are wanted, (n,), none after them; None for all.
    """
    first = 0
    for lines in _lines(path):
        if wanted is not None:
            chosen = wanted[first : first + len(lines)]
            first += len(lines)
            lines = [line for line, is_wanted in zip(lines, chosen.tolist(), strict=False) if is_wanted]
        if lines:
            yield np.fromstring(b",".join(lines), sep=",").reshape(len(lines), -1)


def read_series(path: Path, *columns: int) -> list[Array]:
    """Return some columns of a log, each with the numbers of all its complete rows, (n,)."""
    series = [array("d") for _ in columns]
    for lines in _lines(path):
        rows = [line.split(b",", max(columns) + 1) for line in lines]
        for numbers, column in zip(series, columns, strict=True):
            numbers.extend([float(row[column]) for row in rows])
    return [np.frombuffer(numbers) for numbers in series]


def at_times(times_s: Array, instants_s: Array) -> NDArray[np.bool_]:
    """Return which of some times (n,) are, to the microsecond, among instants that are in their order, (n,)."""
    instants_us = np.append(instants_s, np.nan)
    np.round(np.multiply(instants_us, 1e6, out=instants_us), out=instants_us)
    found = np.empty(len(times_s), dtype=np.bool_)
    for first in range(0, len(times_s), _AT_ONCE):
        times_us = np.round(times_s[first : first + _AT_ONCE] * 1e6)
        at = np.searchsorted(instants_us[:-1], times_us)
        found[first : first + _AT_ONCE] = instants_us[at] == times_us
    return found


class Rows:
    """The rows of a log, as many at a time as are asked for."""

    def __init__(self, path: Path, wanted: NDArray[np.bool_] | None = None) -> None:
        """Take the rows that `read_blocks` yields."""
        self._blocks = read_blocks(path, wanted)
        self._rest: Array = np.empty((0, len(read_columns(path))))

    def take(self, count: int) -> Array:
        """Return the next `count` rows, (count, columns); fewer at the end of the log."""
        parts = [self._rest]
        missing = count - len(self._rest)
        while missing > 0 and (block := next(self._blocks, None)) is not None:
            parts.append(block)
            missing -= len(block)
        rows = np.concatenate(parts)
        self._rest = rows[count:]
        return rows[:count]


def _lines(path: Path) -> Iterator[list[bytes]]:
    """Yield the complete lines behind the first in blocks: those that end, and have as many columns as that has."""
    with path.open("rb") as log:
        commas = log.readline().count(b",")
        rest = b""
        while text := log.read(BLOCK_BYTES):
            *lines, rest = (rest + text).split(b"\n")
            yield [line for line in lines if line.count(b",") == commas]
