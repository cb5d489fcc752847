"""UDP ports for clients without I/O, and relays that damage the traffic."""

import random
import socket
from abc import ABC, abstractmethod
from select import select
from threading import Event, Thread
from time import monotonic
from typing import Protocol, Self

_LOOK_EVERY_S = 0.05
_BUFFER_BYTES, _MOST_BYTES = 4_000_000, 4096


def bound_socket() -> tuple[socket.socket, str]:
    """Return a socket on a free port, and its URL."""
    bound = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
    bound.bind(("127.0.0.1", 0))
    return bound, f"udpout:127.0.0.1:{bound.getsockname()[1]}"


class Talker(Protocol):
    """Answers datagrams of the vehicle."""

    def receive(self, datagram: bytes, now_s: float) -> list[bytes]: ...


class ServedSockets(ABC):
    """Sockets that a thread serves within a block."""

    def __init__(self, *sockets: socket.socket) -> None:
        self._sockets = sockets
        self._ended = Event()
        self._thread = Thread(target=self._run, daemon=True)

    @abstractmethod
    def take(self, bound: socket.socket) -> None:
        """Read a datagram from a socket that has one."""

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()
        for bound in self._sockets:
            bound.close()

    def _run(self) -> None:
        while not self._ended.is_set():
            for bound in select(self._sockets, [], [], _LOOK_EVERY_S)[0]:
                self.take(bound)


class OnPort(ServedSockets):
    """Connects a client, within a block, to a vehicle that serves `url`."""

    def __init__(self, talker: Talker) -> None:
        self.sender: tuple[str, int] | None = None
        self._talker = talker
        self._socket, self.url = bound_socket()
        super().__init__(self._socket)

    def send(self, datagram: bytes) -> None:
        assert self.sender is not None, "nothing has been received"
        self._socket.sendto(datagram, self.sender)

    def take(self, bound: socket.socket) -> None:
        datagram, self.sender = bound.recvfrom(_MOST_BYTES)
        for answer in self._talker.receive(datagram, monotonic()):
            self.send(answer)


LOSS, DUPLICATION, REORDERING = 0.2, 0.1, 0.1  # parts of the datagrams on a `BadLink`


class Relay(ServedSockets):
    """Stands between a plant and an autopilot, which calls `url`."""

    def __init__(self, plant_url: str) -> None:
        _, host, port = plant_url.split(":")
        self._plant = (host, int(port))
        self._near, self.url = bound_socket()
        self._far, _ = bound_socket()
        self._autopilot: tuple[str, int] | None = None
        super().__init__(self._near, self._far)

    @abstractmethod
    def pass_on(self, to: str, datagram: bytes) -> None:
        """Handle a datagram for `plant` or `autopilot`."""

    def deliver(self, to: str, datagram: bytes) -> None:
        if to == "plant":
            self._far.sendto(datagram, self._plant)
        elif self._autopilot:
            self._near.sendto(datagram, self._autopilot)

    def take(self, bound: socket.socket) -> None:
        datagram, sender = bound.recvfrom(_MOST_BYTES)
        if bound is self._near:
            self._autopilot = sender
        self.pass_on("plant" if bound is self._near else "autopilot", datagram)


class BadLink(Relay):
    """A relay like a bad radio link, both ways."""

    def __init__(self, plant_url: str, seed: int) -> None:
        super().__init__(plant_url)
        self._chance = random.Random(seed)
        self._held: dict[str, bytes] = {}
        self.counts = {"passed": 0, "lost": 0, "duplicated": 0, "reordered": 0}

    def pass_on(self, to: str, datagram: bytes) -> None:
        fate = self._chance.random()
        if fate < LOSS:
            self.counts["lost"] += 1
        elif fate < LOSS + REORDERING and to not in self._held:
            self.counts["reordered"] += 1
            self._held[to] = datagram
        else:
            self.counts["passed"] += 1
            self.deliver(to, datagram)
            if fate > 1.0 - DUPLICATION:
                self.counts["duplicated"] += 1
                self.deliver(to, datagram)
            if to in self._held:
                self.deliver(to, self._held.pop(to))
