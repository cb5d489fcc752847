"""UDP ports for clients without I/O, and relays."""

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
    """Sockets served in turns, or within a block by a thread."""

    sockets: tuple[socket.socket, ...]

    def __init__(self) -> None:
        self._ended = Event()

    @abstractmethod
    def take(self, bound: socket.socket) -> None:
        """Read a datagram from a socket that has one."""

    def close(self) -> None:
        for bound in self.sockets:
            bound.close()

    def __enter__(self) -> Self:
        self._thread = Thread(target=self._run, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()
        self.close()

    def _run(self) -> None:
        while not self._ended.is_set():
            serve(self)


def serve(*servers: ServedSockets) -> None:
    """Wait for datagrams, at most 50 ms, and take one from each socket that has one."""
    owners = {bound: server for server in servers for bound in server.sockets}
    for bound in select(list(owners), [], [], _LOOK_EVERY_S)[0]:
        owners[bound].take(bound)


class OnPort(ServedSockets):
    """Connects a client, within a block, to a vehicle that serves `url`."""

    def __init__(self, talker: Talker) -> None:
        self.sender: tuple[str, int] | None = None
        self._talker = talker
        bound, self.url = bound_socket()
        self.sockets = (bound,)
        super().__init__()

    def send(self, datagram: bytes) -> None:
        assert self.sender is not None, "nothing has been received"
        self.sockets[0].sendto(datagram, self.sender)

    def take(self, bound: socket.socket) -> None:
        datagram, self.sender = bound.recvfrom(_MOST_BYTES)
        for answer in self._talker.receive(datagram, monotonic()):
            self.send(answer)


class Relay(ServedSockets):
    """Stands between a plant and an autopilot, which calls `url`."""

    def __init__(self, plant_url: str) -> None:
        _, host, port = plant_url.split(":")
        self._plant = (host, int(port))
        self.open()
        super().__init__()

    def open(self) -> None:
        """Open new sockets, for the next autopilot."""
        self._near, self.url = bound_socket()
        self._far, _ = bound_socket()
        self.sockets = (self._near, self._far)
        self._autopilot: tuple[str, int] | None = None

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
