"""A channel: one remote address on one link."""

from colibri.common.types import Address
from colibri.mavlink.node.router import Source
from colibri.mavlink.wire.dialect import Codec, Message, sequence_of

DATAGRAM_BYTES = 1400  # fits a datagram on common networks
SOURCES = 64  # limit of those remembered per channel; the oldest is forgotten
_SEQUENCES = 256


class Channel:
    """Numbering, packing and counting of the traffic with one address."""

    def __init__(self, number: int, link: int, address: Address | None, codec: Codec, now_us: int) -> None:
        self.number = number
        self.link = link
        self.address = address
        self.fixed = False  # open even when silent
        self.codec = codec  # its own, for its sequence numbers
        self.active_us = now_us
        self.received = 0
        self.sent = 0  # including forwarded messages
        self.lost = 0  # by gaps in sequence numbers
        self._sequences: dict[Source, int] = {}
        self.sources_us: dict[Source, int] = {}
        self._pending: list[bytes] = []

    def receive(self, message: Message, now_us: int) -> None:
        self.active_us = now_us
        self.received += 1
        self.sources_us[message.source] = now_us
        sequence = sequence_of(message.frame)
        last = self._sequences.get(message.source)
        if last is not None:
            gap = (sequence - last - 1) % _SEQUENCES
            if gap >= _SEQUENCES // 2:
                return  # one that was overtaken, or came twice
            self.lost += gap
        elif len(self._sequences) == SOURCES:
            oldest = next(iter(self._sequences))
            del self._sequences[oldest], self.sources_us[oldest]
        self._sequences[message.source] = sequence

    def say(self, frame: bytes) -> None:
        self.sent += 1
        self._pending.append(frame)

    def take(self) -> list[bytes]:
        if not self._pending:
            return []
        datagrams: list[bytes] = []
        packed: list[bytes] = []
        size = 0
        for frame in self._pending:
            size += len(frame)
            if size > DATAGRAM_BYTES:
                datagrams.append(b"".join(packed))
                packed, size = [], len(frame)
            packed.append(frame)
        self._pending = []
        return [*datagrams, b"".join(packed)]

    @property
    def sources(self) -> tuple[Source, ...]:
        return tuple(self._sequences)

    @property
    def received_us(self) -> int | None:
        return self.active_us if self.received else None

    @property
    def dropped(self) -> int:
        return self.codec.dropped.total()
