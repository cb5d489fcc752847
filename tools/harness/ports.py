"""UDP ports for clients without I/O."""

import socket
from select import select
from threading import Event, Thread
from time import monotonic
from typing import Protocol, Self

_LOOK_EVERY_S = 0.05
_BUFFER_BYTES = 4_000_000


def bound_socket() -> tuple[socket.socket, str]:
    """Return a socket on a free port, and its URL."""
    bound = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
    bound.bind(("127.0.0.1", 0))
    return bound, f"udpout:127.0.0.1:{bound.getsockname()[1]}"


class Talker(Protocol):
    """Answers datagrams of the vehicle."""

    def receive(self, datagram: bytes, now_s: float) -> list[bytes]: ...


class OnPort:
    """Connects a client, within a block, to a vehicle that serves `url`."""

    def __init__(self, talker: Talker) -> None:
        self.sender: tuple[str, int] | None = None
        self._talker = talker
        self._socket, self.url = bound_socket()
        self._ended = Event()
        self._thread = Thread(target=self._run, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()
        self._socket.close()

    def send(self, datagram: bytes) -> None:
        assert self.sender is not None, "nothing has been received"
        self._socket.sendto(datagram, self.sender)

    def _run(self) -> None:
        while not self._ended.is_set():
            if select([self._socket], [], [], _LOOK_EVERY_S)[0]:
                datagram, self.sender = self._socket.recvfrom(4096)
                for answer in self._talker.receive(datagram, monotonic()):
                    self.send(answer)
