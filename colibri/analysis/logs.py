"""Read a flight's topics in blocks, in bounded memory."""

from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from colibri.common.errors import InFlightError
from colibri.common.types import Array
from colibri.mavlink.ulog.flight_topics import DECISION, TRUTH, Topic
from colibri.mavlink.ulog.log import TopicReader
from colibri.mavlink.ulog.reader import FILE, FlightFile

_AT_ONCE = 4096
_MOST = 1e30  # powers of such values are finite
_FINITE = {TRUTH.name: list(range(18)), DECISION.name: [*range(6), *range(10, 14)]}  # columns that are always finite
_NUMBERS = msgspec.json.Encoder()


class RecordingError(InFlightError):
    """The log contains no flight."""


def log_of(folder: Path) -> FlightFile:
    """Open the log in the folder of a flight."""
    try:
        return FlightFile(folder / FILE)
    except FileNotFoundError as error:
        raise RecordingError(f"{folder / FILE} is missing: the flight ended before it began") from error


def read_blocks(log: TopicReader, topic: Topic, wanted: NDArray[np.bool_] | None = None) -> Iterator[Array]:
    """Yield rows, or masked ones, in blocks (k, columns), k > 0."""
    first = 0
    for block in log.blocks(topic):
        if wanted is not None:
            chosen = wanted[first : first + len(block)]
            first += len(block)
            block = block[: len(chosen)][chosen]
        if len(block):
            _check(topic, block)
            yield block


def _check(topic: Topic, block: Array) -> None:
    """Refuse rows of a damaged file or a diverged flight."""
    sound = (np.abs(block[:, _FINITE.get(topic.name, [0])]) < _MOST).all(axis=1)
    if not sound.all():
        row = int(np.argmin(sound))
        raise RecordingError(f"{topic.name} at t = {block[row, 0]:g} s: not a finite number: the log is damaged")


def read_series(log: TopicReader, topic: Topic, *columns: str) -> list[Array]:
    """Return some columns of a topic, each (n,)."""
    places = [topic.names.index(column) for column in columns]
    parts = [np.empty((len(columns), 0)), *(block[:, places].T for block in log.blocks(topic))]
    return list(np.concatenate(parts, axis=1))


def at_times(times_s: Array, instants_s: Array) -> NDArray[np.bool_]:
    """Return which times are, to the microsecond, among sorted instants, (n,)."""
    instants_us = np.append(instants_s, np.nan)
    np.round(np.multiply(instants_us, 1e6, out=instants_us), out=instants_us)
    found = np.empty(len(times_s), dtype=np.bool_)
    for first in range(0, len(times_s), _AT_ONCE):
        times_us = np.round(times_s[first : first + _AT_ONCE] * 1e6)
        at = np.searchsorted(instants_us[:-1], times_us)
        found[first : first + _AT_ONCE] = instants_us[at] == times_us
    return found


def csv_rows(table: Array) -> bytes:
    """Encode rows exactly; JSON is faster than `repr`, but only finite."""
    rows = table.tolist()
    if np.isfinite(table).all():
        return _NUMBERS.encode(rows)[2:-2].replace(b"],[", b"\n") + b"\n"
    return "".join(",".join(map(repr, row)) + "\n" for row in rows).encode()


class Rows:
    """The rows of a topic, in portions of any size."""

    def __init__(self, log: TopicReader, topic: Topic, wanted: NDArray[np.bool_] | None = None) -> None:
        self._blocks = read_blocks(log, topic, wanted)
        self._rest: Array = np.empty((0, len(topic.names)))

    def take(self, count: int) -> Array:
        parts = [self._rest]
        missing = count - len(self._rest)
        while missing > 0 and (block := next(self._blocks, None)) is not None:
            parts.append(block)
            missing -= len(block)
        rows = np.concatenate(parts)
        self._rest = rows[count:]
        return rows[:count]
