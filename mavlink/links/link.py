"""The interface of links to ground stations, and their common parts."""

import os
from collections import deque
from time import perf_counter
from typing import Protocol

from colibri.common.types import Address
from colibri.mavlink.errors import MavlinkError

SPIN_S = 1e-3  # time to poll before sleeping, if the previous wait was as short: a wake-up costs more
give_way = getattr(os, "sched_yield", lambda: None)


class LinkError(MavlinkError):
    """A link cannot be opened or used."""


class GroundLink(Protocol):
    """A non-blocking link to ground stations.

    Each cycle: `receive_now`, open channels for `take_opened`, handle the input, close channels for `take_closed`.
    """

    url: str

    @property
    def target(self) -> Address | None: ...

    def send(self, datagram: bytes, address: Address | None = None) -> None:
        """Send whole frames to `address`, or lose them."""

    def receive_now(self) -> list[tuple[bytes, Address]]: ...

    def wait(self, timeout_s: float) -> None: ...

    def take_opened(self) -> list[Address]:
        """Return new addresses to send to."""

    def take_closed(self) -> list[Address]: ...

    def take_notes(self) -> list[str]: ...

    def close(self) -> None: ...


class Endpoint:
    def __init__(self, url: str, target: Address | None) -> None:
        self.url = url
        self.target = target
        self._opened: list[Address] = []
        self._closed: list[Address] = []
        self._notes: list[str] = []

    def take_opened(self) -> list[Address]:
        opened, self._opened = self._opened, []
        return opened

    def take_closed(self) -> list[Address]:
        closed, self._closed = self._closed, []
        return closed

    def take_notes(self) -> list[str]:
        notes, self._notes = self._notes, []
        return notes


class BlockingReceiver:
    """Datagram-by-datagram reception from any link, as with `UdpLink`."""

    def __init__(self, link: GroundLink) -> None:
        self._link = link
        self._waiting: deque[tuple[bytes, Address]] = deque()
        self.url = link.url

    def send(self, datagram: bytes, address: Address | None = None) -> None:
        self._link.send(datagram, address)

    def receive(self, timeout_s: float) -> tuple[bytes, Address] | None:
        if not self._waiting:
            self._waiting.extend(receive_soon(self._link, timeout_s))
        return self._waiting.popleft() if self._waiting else None

    def take_notes(self) -> list[str]:
        return self._link.take_notes()

    def close(self) -> None:
        self._link.close()


def receive_soon(link: GroundLink, timeout_s: float) -> list[tuple[bytes, Address]]:
    """Return input as soon as there is any; poll without sleep for `SPIN_S`."""
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
