"""Reader of flight logs: Colibri's topics and inputs, block by block."""

from collections.abc import Iterator
from mmap import ACCESS_READ, MADV_DONTNEED, mmap
from pathlib import Path

import numpy as np

from colibri.common.files import regular
from colibri.common.types import Array
from colibri.mavlink.errors import MavlinkError
from colibri.mavlink.ulog import messages
from colibri.mavlink.ulog.flight_topics import FLIGHT_TOPICS, MORE_TRUTH, Topic
from colibri.mavlink.ulog.inputs import CONTENT_BYTES, INPUT_NUMBER, InputRecord, decode_inputs

FILE = "flight.ulg"  # in a flight's folder
ROWS_AT_ONCE = 4096
_BLOCK_ROWS = 128
_MAPPED_BYTES = 1 << 23  # memory limit, independent of the flight's length
_KINDS = frozenset(b"BFIMPASDLCORQ")


class LogFormatError(MavlinkError):
    """The file is not a flight log."""


class FlightFile:
    """A flight log; after a killed process, its last message may be truncated."""

    def __init__(self, path: Path) -> None:
        self._path = path
        with open(path, "rb", opener=regular) as file:
            self._size = path.stat().st_size
            self._log = mmap(file.fileno(), self._size, access=ACCESS_READ) if self._size else b""
        self._runs: dict[int, list[tuple[int, int]]] = {topic.number: [] for topic in FLIGHT_TOPICS}
        self._runs[INPUT_NUMBER] = []
        self._formats: set[bytes] = set()
        self._index()

    def blocks(self, topic: Topic) -> Iterator[Array]:
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
        yield self._log[:]

    def inputs(self) -> Iterator[InputRecord]:
        size = messages.HEAD_BYTES + CONTENT_BYTES
        places = (at for begin, count in self._runs[INPUT_NUMBER] for at in range(begin, begin + count * size, size))
        return decode_inputs(self._log[at + messages.HEAD_BYTES : at + size] for at in places)

    def _index(self) -> None:
        log, end = self._log, self._size
        if log[: len(messages.MAGIC)] != messages.MAGIC:
            raise LogFormatError(f"{self._path}: not a ULog")
        at = released = messages.HEADER_BYTES
        while at + messages.HEAD_BYTES <= end:
            head = log[at : at + messages.HEAD_BYTES + 2]
            size = int.from_bytes(head[:2], "little") + messages.HEAD_BYTES
            if head[2] not in _KINDS or at + size > end:
                found = log.find(messages.SYNC, at + 1)
                at = end if found < 0 else found
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
        for topic in FLIGHT_TOPICS[: FLIGHT_TOPICS.index(MORE_TRUTH)]:  # older logs have no others
            if messages.format_of(topic.name, topic.fields) not in self._formats:
                raise LogFormatError(f"{self._path}: no log of a flight of this version")

    def _add_run(self, at: int, head: bytes, size: int) -> int:
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
        if isinstance(self._log, mmap):
            self._log.madvise(MADV_DONTNEED)
