"""UDP endpoints by URL: `udpin:HOST:PORT` waits for whoever sends, `udpout:HOST:PORT` speaks with that address only."""

import os
import socket
from select import select
from time import perf_counter

Address = tuple[str, int]

SPIN_S = 1e-3
"""How long to look for a datagram before going to sleep: on loopback a wake-up costs more than the exchange.

Only where the wait before was no longer than this: a flight that is paced to the wall clock sleeps between its frames.
Each look gives the core away if somebody else could use it: that may be the very process that is waited for.
"""
_give_way = getattr(os, "sched_yield", lambda: None)
_LARGEST_DATAGRAM = 4096


class LinkError(Exception):
    """A link that cannot be opened or used; the message is the one line that a user needs."""


class UdpLink:
    """A UDP socket that never blocks for longer than it is told.

    Attributes:
        url: The URL of the endpoint, with the port that it really has.
    """

    def __init__(self, sock: socket.socket, url: str, target: Address | None) -> None:
        """Wrap a bound socket; with a `target`, hear nobody else."""
        sock.setblocking(False)
        self._socket = sock
        self._target = target
        self._waited_s = 0.0
        self.url = url

    def send(self, datagram: bytes, address: Address | None = None) -> None:
        """Send to `address`, or to the target. What the network will not take now is lost, as UDP may lose it.

        Raises:
            LinkError: The target can never be reached from here.
        """
        destination = address or self._target
        assert destination is not None, "an endpoint that waits needs an address to send to"
        try:
            self._socket.sendto(datagram, destination)
        except (BlockingIOError, ConnectionRefusedError):
            return
        except OSError as error:
            if address is not None:
                return  # a sender may lie about where it is
            raise LinkError(f"cannot send to {destination[0]}:{destination[1]}: {error.strerror}") from error

    def receive(self, timeout_s: float) -> tuple[bytes, Address] | None:
        """Return the next datagram and its sender, or None after `timeout_s`."""
        began_s = perf_counter()
        give_up_s = began_s + timeout_s
        spin_until_s = began_s + (SPIN_S if self._waited_s <= SPIN_S else 0.0)
        while (received := self._receive_now()) is None:
            now_s = perf_counter()
            if now_s >= give_up_s:
                break
            if now_s >= spin_until_s:
                select([self._socket], [], [], give_up_s - now_s)
            else:
                _give_way()
        self._waited_s = perf_counter() - began_s
        return received

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _receive_now(self) -> tuple[bytes, Address] | None:
        try:
            datagram, sender = self._socket.recvfrom(_LARGEST_DATAGRAM)
        except (BlockingIOError, ConnectionRefusedError):
            return None
        if self._target is not None and sender != self._target:
            return None
        return datagram, sender


def open_link(url: str) -> UdpLink:
    """Open the endpoint that `url` names; port 0 with `udpin:` takes any free port.

    Raises:
        LinkError: The URL is malformed, the host unknown, or the port taken.
    """
    scheme, host, port = _parse(url)
    try:
        address: Address = (socket.gethostbyname(host), port)
    except OSError as error:
        raise LinkError(f"{url}: unknown host {host}") from error
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    if scheme == "udpout":
        return UdpLink(sock, url, address)
    try:
        sock.bind(address)
    except OSError as error:
        sock.close()
        raise LinkError(f"{url}: {error.strerror}; end the program that has this port, or name another") from error
    return UdpLink(sock, f"udpin:{host}:{sock.getsockname()[1]}", None)


def _parse(url: str) -> tuple[str, str, int]:
    scheme, _, rest = url.partition(":")
    host, _, port = rest.rpartition(":")
    if scheme not in ("udpin", "udpout") or not host or not port.isdecimal() or int(port) > 65535:
        raise LinkError(f"{url}: expected udpin:HOST:PORT or udpout:HOST:PORT")
    if scheme == "udpout" and int(port) == 0:
        raise LinkError(f"{url}: port 0 is no port to send to")
    return scheme, host, int(port)
