"""Endpoints by URL.

`udpin:HOST:PORT` waits for whoever sends, `udpout:HOST:PORT` speaks with that address only; `tcpin:HOST:PORT` waits for
clients, `tcp:HOST:PORT` calls a server. The link between plant and autopilot is UDP.
"""

import os
import socket
from collections import deque
from ipaddress import ip_address
from select import select
from time import perf_counter
from typing import Protocol

from mavlink.tcp import Address, TcpClient, TcpServer

SPIN_S = 1e-3
"""How long to look for a datagram before going to sleep: on loopback a wake-up costs more than the exchange.

Only where the wait before was no longer than this: a flight that is paced to the wall clock sleeps between its frames.
Each look gives the core away if somebody else could use it: that may be the very process that is waited for.
"""
_give_way = getattr(os, "sched_yield", lambda: None)
_LARGEST_DATAGRAM = 4096
_DATAGRAMS_AT_ONCE = 64
"""So that whoever sends without a pause cannot hold the process up."""
_UDP = ("udpin", "udpout")
_TCP = ("tcpin", "tcp")


class LinkError(Exception):
    """A link that cannot be opened or used; the message is the one line that a user needs."""


class GroundLink(Protocol):
    """A link to ground stations: nothing that it does blocks.

    Each time: `receive_now`, then open channels for `take_opened`, hear what was received, and close channels for
    `take_closed`.

    Attributes:
        url: The URL of the endpoint, with the port that it really has.
        target: Whom it calls; None where it waits for others.
    """

    url: str

    @property
    def target(self) -> Address | None:
        """Whom it calls; None where it waits for others."""
        ...

    def send(self, datagram: bytes, address: Address | None = None) -> None:
        """Send whole frames to `address`; what cannot be sent now is lost."""
        ...

    def receive_now(self) -> list[tuple[bytes, Address]]:
        """Return what has come, as whole frames, and from where."""
        ...

    def wait(self, timeout_s: float) -> None:
        """Sleep until something has come, but no longer than `timeout_s`."""
        ...

    def take_opened(self) -> list[Address]:
        """Return who is to be spoken to unasked since last asked: whom the link calls, who has connected."""
        ...

    def take_closed(self) -> list[Address]:
        """Return whose connections have ended since last asked."""
        ...

    def close(self) -> None:
        """Close every socket."""
        ...


class UdpLink:
    """A UDP socket that never blocks for longer than it is told.

    Attributes:
        url: The URL of the endpoint, with the port that it really has.
        target: Whom it speaks with; None for whoever sends.
        spin_s: How long to look for a datagram before going to sleep.
    """

    def __init__(self, sock: socket.socket, url: str, target: Address | None) -> None:
        """Wrap a bound socket; with a `target`, hear nobody else."""
        sock.setblocking(False)
        self._socket = sock
        self.target = target
        self.spin_s = SPIN_S
        self._waited_s = 0.0
        self._opened = [] if target is None else [target]
        self.url = url

    def send(self, datagram: bytes, address: Address | None = None) -> None:
        """Send to `address`, or to the target. What the network will not take now is lost, as UDP may lose it.

        Raises:
            LinkError: The target can never be reached from here.
        """
        destination = address or self.target
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
        spin_until_s = began_s + (self.spin_s if self._waited_s <= self.spin_s else 0.0)
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

    def receive_now(self) -> list[tuple[bytes, Address]]:
        """Return the datagrams that have come, and their senders."""
        received = []
        for _ in range(_DATAGRAMS_AT_ONCE):
            try:
                datagram, sender = self._socket.recvfrom(_LARGEST_DATAGRAM)
            except ConnectionRefusedError:
                continue
            except BlockingIOError:
                break
            if self.target is None or sender == self.target:
                received.append((datagram, sender))
        return received

    def wait(self, timeout_s: float) -> None:
        """Sleep until a datagram has come, but no longer than `timeout_s`."""
        select([self._socket], [], [], timeout_s)

    def take_opened(self) -> list[Address]:
        """Return the target, once."""
        opened, self._opened = self._opened, []
        return opened

    def take_closed(self) -> list[Address]:
        """Return nobody: UDP has no connections."""
        return []

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _receive_now(self) -> tuple[bytes, Address] | None:
        try:
            datagram, sender = self._socket.recvfrom(_LARGEST_DATAGRAM)
        except (BlockingIOError, ConnectionRefusedError):
            return None
        if self.target is not None and sender != self.target:
            return None
        return datagram, sender


class OneByOne:
    """A link of any kind, used as `UdpLink` is: what has come is handed out one by one.

    Attributes:
        url: The URL of the endpoint.
    """

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
            _give_way()
        else:
            link.wait(timeout_s - waited_s)
    return received


def open_link(url: str) -> UdpLink:
    """Open the UDP endpoint that `url` names; port 0 with `udpin:` takes any free port.

    Raises:
        LinkError: The URL is malformed, the host unknown, or the port taken.
    """
    return _open_udp(url, *_parse(url, _UDP))


def open_ground_link(url: str) -> GroundLink:
    """Open the endpoint that `url` names, of UDP or TCP; port 0 takes any free port where it waits.

    Raises:
        LinkError: The URL is malformed, the host unknown, or the port taken.
    """
    scheme, host, port = _parse(url, (*_UDP, *_TCP))
    if scheme in _UDP:
        return _open_udp(url, scheme, host, port)
    address = (_resolved(url, host), port)
    if scheme == "tcp":
        return TcpClient(url, address)
    sock = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    if os.name == "posix":  # elsewhere this would let two programs have one port
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    _bind(sock, url, address, listen=True)
    return TcpServer(sock, f"tcpin:{host}:{sock.getsockname()[1]}")


def beyond_loopback(url: str) -> bool:
    """Whether the endpoint that `url` names can be reached from, or reaches, another computer.

    Raises:
        LinkError: The URL is malformed, or the host unknown.
    """
    _, host, _ = _parse(url, (*_UDP, *_TCP))
    return not ip_address(_resolved(url, host)).is_loopback


def unsigned_refusal(url: str) -> str:
    """Return the line that refuses to open a link beyond loopback without a key."""
    return f"{url} reaches beyond this computer: give --signing-key FILE, or --insecure to let anybody fly the vehicle"


def _open_udp(url: str, scheme: str, host: str, port: int) -> UdpLink:
    address = (_resolved(url, host), port)
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    if scheme == "udpout":
        return UdpLink(sock, url, address)
    _bind(sock, url, address)
    return UdpLink(sock, f"udpin:{host}:{sock.getsockname()[1]}", None)


def _resolved(url: str, host: str) -> str:
    try:
        return socket.gethostbyname(host)
    except (OSError, UnicodeError) as error:
        raise LinkError(f"{url}: unknown host {host}") from error


def _bind(sock: socket.socket, url: str, address: Address, *, listen: bool = False) -> None:
    try:
        sock.bind(address)
        if listen:
            sock.listen()
    except OSError as error:
        sock.close()
        raise LinkError(f"{url}: {error.strerror}; end the program that has this port, or name another") from error


def _parse(url: str, schemes: tuple[str, ...]) -> tuple[str, str, int]:
    scheme, _, rest = url.partition(":")
    host, _, port = rest.rpartition(":")
    if scheme not in schemes or not host or not port.isdecimal() or int(port) > 65535:
        raise LinkError(f"{url}: expected " + " or ".join(f"{scheme}:HOST:PORT" for scheme in schemes))
    if scheme in ("udpout", "tcp") and int(port) == 0:
        raise LinkError(f"{url}: port 0 is no port to send to")
    return scheme, host, int(port)
