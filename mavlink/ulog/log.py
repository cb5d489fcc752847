"""The log of a flight: topics as rows, a block at a time to a file, or kept in memory."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Protocol, TypeAlias

import numpy as np

from colibri.common.process.log_files import LogError, LogFile
from colibri.common.types import Array
from colibri.mavlink.ulog import messages
from colibri.mavlink.ulog.blocks import Blocks
from colibri.mavlink.ulog.flight_topics import FLIGHT_TOPICS, Topic

ROWS_AT_ONCE = 4096
"""Rows that are read at once: some seconds of a flight."""
_QUEUED = 64

RowEncoder: TypeAlias = Topic | Blocks
"""Encodes rows of a topic, or of several of PX4's."""


class TopicReader(Protocol):
    """What a flight has left, by topic."""

    def blocks(self, topic: Topic) -> Iterator[Array]:
        """Yield the rows of a topic in their order, in blocks (n, columns), n > 0."""
        ...

    def encoded(self) -> Iterator[bytes]:
        """Yield a file with all topics, part by part."""
        ...


class TopicLog(ABC):
    """Takes the topics of a flight.

    Attributes:
        for_viewers: Whether PX4's topics are recorded, too, and what it takes to replay the flight.
    """

    for_viewers = True

    def __init__(self) -> None:
        self._waiting: dict[RowEncoder, list[bytes]] = {}
        self._queued: list[bytes] = []
        self._beginning = b""

    def begin(self, beginning: bytes) -> None:
        """Note the beginning of a file, where one may be written of this later."""
        self._beginning = beginning

    def add(self, encoder: RowEncoder, row: Sequence[float]) -> None:
        """Add a row.

        Raises:
            LogError: It cannot be written.
        """
        waiting = self._waiting.get(encoder)
        if waiting is None:
            waiting = self._waiting[encoder] = []
        waiting.append(encoder.pack.pack(*row))
        if len(waiting) >= encoder.block_rows:
            self._take(encoder)

    def queue(self, encoded: bytes) -> None:
        """Have messages written before the next block.

        Raises:
            LogError: They cannot be written.
        """
        self._queued.append(encoded)
        if len(self._queued) >= _QUEUED:
            self._append_queued()

    def flush(self) -> None:
        """Write what waits.

        Raises:
            LogError: It cannot be written.
        """
        self._append_queued()
        for encoder, waiting in self._waiting.items():
            if waiting:
                self._take(encoder)

    @abstractmethod
    def append(self, encoded: bytes) -> None:
        """Append messages.

        Raises:
            LogError: They cannot be written.
        """

    def close(self) -> None:
        """Write what waits, if that can be done, and close."""
        with suppress(LogError):
            self.flush()

    def _take(self, encoder: RowEncoder) -> None:
        self._append_queued()
        rows, self._waiting[encoder] = self._waiting[encoder], []
        self._keep(encoder, b"".join(rows))

    def _append_queued(self) -> None:
        queued, self._queued = self._queued, []
        if queued:
            self.append(messages.SYNC + b"".join(queued))

    def _keep(self, encoder: RowEncoder, rows: bytes) -> None:
        self.append(_encoded(encoder, _table(encoder, rows)))


class FileLog(TopicLog):
    """A log in a file, which is opened with the first message."""

    def __init__(self, opened: Callable[[], LogFile]) -> None:
        super().__init__()
        self._opened = opened
        self._file: LogFile | None = None

    def append(self, encoded: bytes) -> None:
        """Append messages."""
        if self._file is None:
            self._file = self._opened()
        self._file.append(encoded)

    def close(self) -> None:
        """Write what waits, if that can be done, and close; the next message opens the file again."""
        super().close()
        if self._file is not None:
            self._file.close()
            self._file = None


class MemoryLog(TopicLog):
    """A log in memory, of rows as they came."""

    def __init__(self, *, for_viewers: bool = False) -> None:
        super().__init__()
        self.for_viewers = for_viewers
        self._rows: dict[Topic, bytearray] = {topic: bytearray() for topic in FLIGHT_TOPICS}
        self._messages = bytearray()

    def append(self, encoded: bytes) -> None:
        """Append messages."""
        self._messages += encoded

    def blocks(self, topic: Topic) -> Iterator[Array]:
        """Yield the rows of a topic in their order, in blocks (n, columns), n > 0."""
        self.flush()
        rows = self._rows[topic]
        step = ROWS_AT_ONCE * topic.pack.size
        for begin in range(0, len(rows), step):
            yield _table(topic, bytes(rows[begin : begin + step]))

    def encoded(self) -> Iterator[bytes]:
        """Yield a file with all topics, part by part."""
        self.flush()
        yield self._beginning
        yield bytes(self._messages)
        for topic in FLIGHT_TOPICS:
            for rows in self.blocks(topic):
                yield _encoded(topic, rows)

    def _keep(self, encoder: RowEncoder, rows: bytes) -> None:
        if isinstance(encoder, Topic):
            self._rows[encoder] += rows
        else:
            super()._keep(encoder, rows)


def _encoded(encoder: RowEncoder, table: Array) -> bytes:
    """Return the messages of a block, behind a mark for readers that have lost their place."""
    with np.errstate(all="ignore"):  # the numbers of a lost vehicle may exceed a single float
        return messages.SYNC + encoder.encode(table)


def _table(encoder: RowEncoder, rows: bytes) -> Array:
    return np.frombuffer(rows).reshape(-1, encoder.pack.size // 8)
