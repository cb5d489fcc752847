"""Clients without input or output, each given a UDP port of this computer."""

import socket
from select import select
from threading import Event, Thread
from time import monotonic
from typing import Protocol, Self

_LOOK_EVERY_S = 0.05
_BUFFER_BYTES = 4_000_000


class Talker(Protocol):
    """Answers datagrams."""

    def receive(self, datagram: bytes, now_s: float) -> list[bytes]:
        """Take in a datagram of the vehicle; return what to send to it."""


class OnPort:
    """Connects a client to the vehicle that sends to a port, while the block lasts.

    Attributes:
        url: The link that the vehicle is to serve.
        sender: The address that the last datagram came from; None before the first.
    """

    def __init__(self, talker: Talker) -> None:
        """Listen on any free port."""
        self.sender: tuple[str, int] | None = None
        self._talker = talker
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
        self._socket.bind(("127.0.0.1", 0))
        self.url = f"udpout:127.0.0.1:{self._socket.getsockname()[1]}"
        self._ended = Event()
        self._thread = Thread(target=self._run, daemon=True)

    def __enter__(self) -> Self:
        """Begin."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """End: from here on the client may be looked at."""
        self._ended.set()
        self._thread.join()
        self._socket.close()

    def send(self, datagram: bytes) -> None:
        """Send a datagram to the address that the last one came from."""
        assert self.sender is not None, "nothing has been received"
        self._socket.sendto(datagram, self.sender)

    def _run(self) -> None:
        while not self._ended.is_set():
            if select([self._socket], [], [], _LOOK_EVERY_S)[0]:
                datagram, self.sender = self._socket.recvfrom(4096)
                for answer in self._talker.receive(datagram, monotonic()):
                    self.send(answer)
