"""Reader of flight logs: the own topics of a ULog, block by block, and its inputs."""

from collections.abc import Iterator
from mmap import ACCESS_READ, MADV_DONTNEED, mmap
from pathlib import Path

import numpy as np

from colibri.common.types import Array
from colibri.mavlink.errors import MavlinkError
from colibri.mavlink.ulog import messages
from colibri.mavlink.ulog.flight_topics import FLIGHT_TOPICS, Topic
from colibri.mavlink.ulog.inputs import CONTENT_BYTES, INPUT_NUMBER, InputRecord, decode_inputs

FILE = "flight.ulg"
"""In the folder of a flight."""
ROWS_AT_ONCE = 4096
_BLOCK_ROWS = 128
_MAPPED_BYTES = 1 << 23
"""So much of a file is in memory at once, however long the flight was."""
_KINDS = frozenset(b"BFIMPASDLCORQ")


class LogFormatError(MavlinkError):
    """A file is no flight log; the message is the one line that a user needs."""


class FlightFile:
    """A flight log that is read by topic; of a process that was killed, the last message may be cut off."""

    def __init__(self, path: Path) -> None:
        """Read where its messages are.

        Raises:
            OSError: It cannot be read.
            LogFormatError: It is no ULog, or one without the topics of this version.
        """
        self._path = path
        with path.open("rb") as file:
            self._size = path.stat().st_size
            self._log = mmap(file.fileno(), self._size, access=ACCESS_READ) if self._size else b""
        self._runs: dict[int, list[tuple[int, int]]] = {topic.number: [] for topic in FLIGHT_TOPICS}
        self._runs[INPUT_NUMBER] = []
        self._formats: set[bytes] = set()
        self._index()

    def blocks(self, topic: Topic) -> Iterator[Array]:
        """Yield the rows of a topic in their order, in blocks (n, columns), n > 0."""
        waiting: list[Array] = []
        for begin, count in self._runs[topic.number]:
            encoded = np.frombuffer(self._log, topic.layout, count, begin)
            waiting.append(topic.decode(encoded))
            if sum(map(len, waiting)) >= ROWS_AT_ONCE:
                yield np.concatenate(waiting)
                waiting = []
                self._release()
        if waiting:
            yield np.concatenate(waiting)

    def encoded(self) -> Iterator[bytes]:
        """Yield the file."""
        yield self._log[:]

    def inputs(self) -> Iterator[InputRecord]:
        """Yield what the autopilot began with and received."""
        yield from decode_inputs(self._chunks())

    def _chunks(self) -> Iterator[bytes]:
        size = messages.HEAD_BYTES + CONTENT_BYTES
        for begin, count in self._runs[INPUT_NUMBER]:
            for chunk in range(begin, begin + count * size, size):
                yield self._log[chunk + messages.HEAD_BYTES : chunk + size]

    def _index(self) -> None:
        log, end = self._log, self._size
        if log[: len(messages.MAGIC)] != messages.MAGIC:
            raise LogFormatError(f"{self._path}: not a ULog")
        at = released = messages.HEADER_BYTES
        while at + messages.HEAD_BYTES <= end:
            head = log[at : at + messages.HEAD_BYTES + 2]
            size = int.from_bytes(head[:2], "little") + messages.HEAD_BYTES
            if head[2] not in _KINDS or at + size > end:
                at = self._next_mark(at + 1)
                continue
            count = 1
            if head[2] == messages.DATA:
                count = self._add_run(at, head, size)
            elif head[2] == messages.FORMAT:
                self._formats.add(log[at : at + size])
            at += count * size
            if at - released > _MAPPED_BYTES:
                self._release()
                released = at
        for topic in FLIGHT_TOPICS:
            if messages.format_of(topic.name, topic.fields) not in self._formats:
                raise LogFormatError(f"{self._path}: no log of a flight of this version")

    def _add_run(self, at: int, head: bytes, size: int) -> int:
        """Add messages of one topic that follow each other; return how many."""
        runs = self._runs.get(int.from_bytes(head[3:], "little"))
        if runs is None:
            return 1
        most = (self._size - at) // size
        count, log = 1, self._log
        if most > 1 and log[at + size : at + size + len(head)] == head:
            most = min(most, _BLOCK_ROWS)
            heads = np.ndarray((most, len(head)), np.uint8, log, at, (size, 1))
            same = (heads == np.frombuffer(head, np.uint8)).all(axis=1)
            count = most if same.all() else int(np.argmin(same))
        runs.append((at, count))
        return count

    def _release(self) -> None:
        """Let the system have the memory of what was read."""
        if isinstance(self._log, mmap):
            self._log.madvise(MADV_DONTNEED)

    def _next_mark(self, at: int) -> int:
        found = self._log.find(messages.SYNC, at)
        return self._size if found < 0 else found
