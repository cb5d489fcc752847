"""The log of a flight: topics as rows, written in blocks or kept in memory."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from importlib.metadata import version as version_of_package
from typing import Protocol, TypeAlias

import numpy as np

from colibri.common.process.log_files import LogError, LogFile
from colibri.common.types import Array
from colibri.mavlink.ulog import messages
from colibri.mavlink.ulog.blocks import Blocks
from colibri.mavlink.ulog.flight_topics import FLIGHT_TOPICS, Topic
from colibri.mavlink.ulog.inputs import INPUT, INPUT_FIELDS, INPUT_NUMBER
from colibri.mavlink.ulog.topics import NUMBERS, PARTS, TOPICS

ROWS_AT_ONCE = 4096  # rows read at once: some seconds of a flight
_QUEUED = 64

RowEncoder: TypeAlias = Topic | Blocks  # encoder of a topic's rows, or of several of PX4's


def beginning(vehicle: str, parameters: Mapping[str, int | float]) -> bytes:
    """Return a file's formats of topics, facts, parameters and subscriptions."""
    own = {topic.name: topic.fields for topic in FLIGHT_TOPICS} | {INPUT: INPUT_FIELDS}
    numbers = NUMBERS | {topic.name: topic.number for topic in FLIGHT_TOPICS} | {INPUT: INPUT_NUMBER}
    formats = [messages.format_of(name, fields) for name, fields in {**PARTS, **TOPICS, **own}.items()]
    facts = {"sys_name": "Colibri", "ver_hw": vehicle, "ver_sw": version_of_package("colibri-sitl")}
    known = messages.information(facts) + messages.parameters(parameters)
    subscriptions = [messages.subscription(name, number) for name, number in numbers.items()]
    return b"".join([messages.header(), *formats, known, *subscriptions])


class TopicReader(Protocol):
    def blocks(self, topic: Topic) -> Iterator[Array]:
        """Yield a topic's rows in order, in blocks (n, columns), n > 0."""
        ...

    def encoded(self) -> Iterator[bytes]: ...


class TopicLog:
    """A log of a flight's topics, by `append` of messages; its methods raise `LogError` if writing fails."""

    for_viewers = True  # also PX4's topics, and inputs for replay

    def __init__(self, append: Callable[[bytes], object]) -> None:
        self.append = append
        self._blocks: dict[RowEncoder, _Block] = {}
        self._queued: list[bytes] = []
        self._beginning = b""

    def begin(self, beginning: bytes) -> None:
        self._beginning = beginning

    def add(self, encoder: RowEncoder, row: Sequence[float]) -> None:
        """Add a row: the time in µs, then the columns."""
        block = self._blocks.get(encoder) or self._begin_block(encoder)
        block.pack_into(block.memory, block.used * block.row_bytes, *row)
        block.used += 1
        if block.used == encoder.block_rows:
            self._take(encoder, block)

    def extend(self, encoder: RowEncoder, rows: Array) -> None:
        """Add rows, (n, columns)."""
        block = self._blocks.get(encoder) or self._begin_block(encoder)
        while len(rows) >= (left := encoder.block_rows - block.used):
            block.put(rows[:left])
            self._take(encoder, block)
            rows = rows[left:]
        block.put(rows)

    def queue(self, encoded: bytes) -> None:
        self._queued.append(encoded)
        if len(self._queued) >= _QUEUED:
            self._append_queued()

    def flush(self) -> None:
        self._append_queued()
        for encoder, block in self._blocks.items():
            if block.used:
                self._take(encoder, block)

    def close(self) -> None:
        with suppress(LogError):
            self.flush()

    def _begin_block(self, encoder: RowEncoder) -> "_Block":
        block = self._blocks[encoder] = _Block(encoder)
        return block

    def _take(self, encoder: RowEncoder, block: "_Block") -> None:
        self._append_queued()
        used, block.used = block.used, 0
        with np.errstate(all="ignore"):  # the numbers of a lost vehicle may exceed a column
            self._keep(encoder, encoder.encode(np.frombuffer(block.memory).reshape(encoder.block_rows, -1)[:used]))

    def _append_queued(self) -> None:
        queued, self._queued = self._queued, []
        if queued:
            self.append(messages.SYNC + b"".join(queued))

    def _keep(self, _encoder: RowEncoder, encoded: bytes) -> None:
        self.append(messages.SYNC + encoded)


class _Block:
    """Memory of rows that wait, packed at once: numbers kept as objects would spread over the caches."""

    __slots__ = ("memory", "pack_into", "row_bytes", "used")

    def __init__(self, encoder: RowEncoder) -> None:
        self.pack_into, self.row_bytes = encoder.pack.pack_into, encoder.pack.size
        self.memory, self.used = bytearray(self.row_bytes * encoder.block_rows), 0

    def put(self, rows: Array) -> None:
        begin, self.used = self.used, self.used + len(rows)
        self.memory[begin * self.row_bytes : self.used * self.row_bytes] = rows.tobytes()


class FileLog(TopicLog):
    """A log in a file, opened with the first message, also after `close`."""

    def __init__(self, opened: Callable[[], LogFile]) -> None:
        super().__init__(self._append)
        self._opened = opened
        self._file: LogFile | None = None

    def _append(self, encoded: bytes) -> None:
        if self._file is None:
            self._file = self._opened()
        self._file.append(encoded)

    def close(self) -> None:
        super().close()
        if self._file is not None:
            self._file.close()
            self._file = None


class MemoryLog(TopicLog):
    def __init__(self, *, for_viewers: bool = False) -> None:
        self._messages = bytearray()
        super().__init__(self._messages.extend)
        self.for_viewers = for_viewers
        self._rows: dict[Topic, bytearray] = {topic: bytearray() for topic in FLIGHT_TOPICS}

    def blocks(self, topic: Topic) -> Iterator[Array]:
        for rows in self._chunks(topic):
            yield topic.decode(np.frombuffer(rows, topic.layout))

    def encoded(self) -> Iterator[bytes]:
        self.flush()
        yield self._beginning
        yield bytes(self._messages)
        for topic in FLIGHT_TOPICS:
            for rows in self._chunks(topic):
                yield messages.SYNC + rows

    def _chunks(self, topic: Topic) -> Iterator[bytes]:
        self.flush()
        rows = self._rows[topic]
        step = ROWS_AT_ONCE * topic.layout.itemsize
        for begin in range(0, len(rows), step):
            yield bytes(rows[begin : begin + step])

    def _keep(self, encoder: RowEncoder, encoded: bytes) -> None:
        if isinstance(encoder, Topic):
            self._rows[encoder] += encoded
        else:
            super()._keep(encoder, encoded)
