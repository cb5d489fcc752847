"""What a link to ground stations is, and one that hands out datagrams one by one."""

import os
from collections import deque
from time import perf_counter
from typing import Protocol

from colibri.common.types import Address
from colibri.mavlink.errors import MavlinkError

SPIN_S = 1e-3
"""How long to look for a datagram before going to sleep: on loopback a wake-up costs more than the exchange.

Only where the wait before was no longer than this: a flight that is paced to the wall clock sleeps between its frames.
Each look gives the core away if somebody else could use it: that may be the very process that is waited for.
"""
give_way = getattr(os, "sched_yield", lambda: None)


class LinkError(MavlinkError):
    """A link that cannot be opened or used; the message is the one line that a user needs."""


class GroundLink(Protocol):
    """A link to ground stations: nothing that it does blocks.

    Each time: `receive_now`, then open channels for `take_opened`, take in what was received, and close channels for
    `take_closed`.
    """

    url: str

    @property
    def target(self) -> Address | None:
        """Whom it calls; None where it waits for others."""

    def send(self, datagram: bytes, address: Address | None = None) -> None:
        """Send whole frames to `address`; what cannot be sent now is lost."""

    def receive_now(self) -> list[tuple[bytes, Address]]:
        """Return what has come, as whole frames, and from where."""

    def wait(self, timeout_s: float) -> None:
        """Sleep until something has come, but no longer than `timeout_s`."""

    def take_opened(self) -> list[Address]:
        """Return the addresses to send to first, since the last call: the one the link calls, those that connected."""

    def take_closed(self) -> list[Address]:
        """Return whose connections have ended since last asked."""

    def take_notes(self) -> list[str]:
        """Return what a user must know of the link since last asked, a line each."""

    def close(self) -> None:
        """Close every socket."""


class Endpoint:
    """What every link keeps besides its socket."""

    def __init__(self, url: str, target: Address | None) -> None:
        """Begin without connections."""
        self.url = url
        self.target = target
        self._opened: list[Address] = []
        self._closed: list[Address] = []
        self._notes: list[str] = []

    def take_opened(self) -> list[Address]:
        """Return the addresses connected since the last call: some clients send nothing before they receive."""
        opened, self._opened = self._opened, []
        return opened

    def take_closed(self) -> list[Address]:
        """Return the addresses whose connections have ended since the last call; none over UDP."""
        closed, self._closed = self._closed, []
        return closed

    def take_notes(self) -> list[str]:
        """Return what a user must know since the last call: that a device has gone, that it is back."""
        notes, self._notes = self._notes, []
        return notes


class BlockingReceiver:
    """A link of any kind, used as `UdpLink` is: what has come is handed out one by one."""

    def __init__(self, link: GroundLink) -> None:
        """Use `link`."""
        self._link = link
        self._waiting: deque[tuple[bytes, Address]] = deque()
        self.url = link.url

    def send(self, datagram: bytes, address: Address | None = None) -> None:
        """Send to `address`, or to whom it speaks with."""
        self._link.send(datagram, address)

    def receive(self, timeout_s: float) -> tuple[bytes, Address] | None:
        """Return what has come next and from where, or None after `timeout_s`."""
        if not self._waiting:
            self._waiting.extend(receive_soon(self._link, timeout_s))
        return self._waiting.popleft() if self._waiting else None

    def take_notes(self) -> list[str]:
        """Return what a user must know of the link since last asked."""
        return self._link.take_notes()

    def close(self) -> None:
        """Close the link."""
        self._link.close()


def receive_soon(link: GroundLink, timeout_s: float) -> list[tuple[bytes, Address]]:
    """Return what has come, as soon as anything has, or nothing after `timeout_s`; for `SPIN_S` without sleeping."""
    began_s = perf_counter()
    while not (received := link.receive_now()):
        waited_s = perf_counter() - began_s
        if waited_s >= timeout_s:
            break
        if waited_s < SPIN_S:
            give_way()
        else:
            link.wait(timeout_s - waited_s)
    return received
