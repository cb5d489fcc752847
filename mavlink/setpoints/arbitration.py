"""Who is obeyed where several clients stream the same kind of order.

The first that streams is, until it has been silent for a time-out; then whoever streams next. A client that claims the
vehicle, by engaging the mode that its stream is for, is from then on, if it streams. A client is a channel, a
system and a component: two programs with the same ids on two links are two.
"""

from typing import Generic, NamedTuple, TypeVar

from colibri.mavlink.node.service import Peer

SILENT_AFTER_US = 500_000
"""A stream without a valid message for longer than this has ended; MAVLink asks clients for 2 Hz at least."""
MAX_CLIENTS = 16

Value = TypeVar("Value")


class Heard(NamedTuple, Generic[Value]):
    """The latest of a stream."""

    value: Value
    time_us: int


class Streams(Generic[Value]):
    """The latest value of each client, and who of them is obeyed.

    Attributes:
        source: The client that is obeyed; None before the first.
    """

    def __init__(self, silent_after_us: int = SILENT_AFTER_US) -> None:
        """Nobody streams yet; a stream has ended after `silent_after_us`."""
        self._silent_after_us = silent_after_us
        self.source: Peer | None = None
        self._heard: dict[Peer, Heard[Value]] = {}

    def hear(self, peer: Peer, value: Value, now_us: int) -> bool:
        """Take in a valid value; return whether it is from the client that is obeyed."""
        if peer not in self._heard and len(self._heard) >= MAX_CLIENTS:
            self._forget_silent(now_us)
            if len(self._heard) >= MAX_CLIENTS:
                return False
        self._heard[peer] = Heard(value, now_us)
        if self.source is None or not self._fresh(self.source, now_us):
            self.source = peer
        return peer == self.source

    def claim(self, peer: Peer, now_us: int) -> None:
        """Obey `peer` from now on, if it streams."""
        if self._fresh(peer, now_us):
            self.source = peer

    def latest(self, now_us: int, timeout_us: int) -> Heard[Value] | None:
        """Return the latest of the client that is obeyed, if it is no older than `timeout_us`."""
        heard = None if self.source is None else self._heard.get(self.source)
        return heard if heard is not None and 0 <= now_us - heard.time_us <= timeout_us else None

    def value(self, peer: Peer, now_us: int) -> Value | None:
        """Return the latest of one client, obeyed or not, if its stream has not ended."""
        return self._heard[peer].value if self._fresh(peer, now_us) else None

    def forget(self, peer: Peer) -> None:
        """Take it that `peer` has ended its stream."""
        self._heard.pop(peer, None)

    def _fresh(self, peer: Peer, now_us: int) -> bool:
        heard = self._heard.get(peer)
        return heard is not None and 0 <= now_us - heard.time_us <= self._silent_after_us

    def _forget_silent(self, now_us: int) -> None:
        self._heard = {peer: heard for peer, heard in self._heard.items() if self._fresh(peer, now_us)}
