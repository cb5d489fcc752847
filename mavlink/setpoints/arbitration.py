"""Services of streamed setpoints, and arbitration between their clients.

The first client that streams is obeyed until it is silent; then the next one. A client that engages the stream's mode
takes over, if it streams. Equal ids on two links are two clients.
"""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterable
from typing import Generic, TypeVar

from colibri.mavlink.node.service import Peer, Send
from colibri.mavlink.services.statustext import WARNING, StatusText
from colibri.mavlink.wire.dialect import Message

SILENT_AFTER_US = 500_000  # silence that ends a stream; MAVLink requires at least 2 Hz
TELL_EVERY_US = 5_000_000
MAX_CLIENTS = 16

Value = TypeVar("Value")


class Refused(Exception):  # noqa: N818 (what happened to a setpoint, not an error of this program)
    """An invalid setpoint: the reason, by which it is counted, and the field to be told."""

    def __init__(self, reason: str, field: str = "") -> None:
        super().__init__(reason)
        self.field = field


class StreamedService(ABC, Generic[Value]):
    """Keeps each client's latest setpoint and obeys that of `source`; `text` tells refusals."""

    handles: frozenset[str]

    def __init__(self, silent_after_us: int = SILENT_AFTER_US, text: StatusText | None = None) -> None:
        self.dropped: Counter[str] = Counter()
        self.source: Peer | None = None
        self._silent_after_us = silent_after_us
        self._received: dict[Peer, tuple[int, Value]] = {}
        self._text, self._told_us = text, -TELL_EVERY_US
        self._refusal: tuple[int, str] = (0, "")
        self.taken: Callable[[Value | None], None] | None = None

    def refusal(self, now_us: int) -> str:
        """Return why the latest setpoint was refused; empty if none was."""
        at_us, why = self._refusal
        return why if now_us - at_us <= self._silent_after_us else ""

    def receive(self, message: Message, peer: Peer, now_us: int) -> Iterable[Send]:
        try:
            value = self._decode(message, peer, now_us)
        except Refused as refused:
            self.dropped[str(refused)] += 1
            if self.taken is not None:
                self.taken(None)
            return self._tell(message.name, refused, now_us) if refused.field else ()
        if value is not None and not self.keep(peer, value, now_us):
            self.dropped["another client"] += 1
        elif value is not None and self.taken is not None:
            self.taken(value)
        return ()

    def _tell(self, name: str, refused: Refused, now_us: int) -> Iterable[Send]:
        why = f"{name} refused: {refused.field}: {refused}"
        self._refusal = (now_us, why)
        if self._text is None or 0 <= now_us - self._told_us < TELL_EVERY_US:
            return ()
        self._told_us = now_us
        return self._text.say(WARNING, why)

    def engage(self, peer: Peer, now_us: int) -> None:
        if self._streams(peer, now_us):
            self.source = peer

    @abstractmethod
    def _decode(self, message: Message, peer: Peer, now_us: int, /) -> Value | None:
        """Return the setpoint in a message, if any; raise `Refused` if it is invalid."""

    def _latest(self, now_us: int, timeout_us: int) -> Value | None:
        return None if self.source is None else self._value(self.source, now_us, timeout_us)

    def _value(self, peer: Peer, now_us: int, timeout_us: int) -> Value | None:
        time_us, value = self._received.get(peer, (now_us + 1, None))
        return value if 0 <= now_us - time_us <= timeout_us else None

    def _streams(self, peer: Peer, now_us: int) -> bool:
        return self._value(peer, now_us, self._silent_after_us) is not None

    def keep(self, peer: Peer, value: Value, now_us: int) -> bool:
        """Take in a client's setpoint; return whether the client is obeyed."""
        if peer not in self._received and len(self._received) >= MAX_CLIENTS:
            self._received = {it: kept for it, kept in self._received.items() if self._streams(it, now_us)}
            if len(self._received) >= MAX_CLIENTS:
                return False
        self._received[peer] = (now_us, value)
        if self.source is None or not self._streams(self.source, now_us):
            self.source = peer
        return peer == self.source
