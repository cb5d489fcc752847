"""A UDP endpoint with bounded blocking."""

import ctypes
import socket
import sys
from contextlib import suppress
from errno import EADDRINUSE
from ipaddress import ip_address
from select import select
from time import perf_counter

from colibri.common.types import Address
from colibri.mavlink.links.link import SPIN_S, Endpoint, LinkError, give_way

_MAX_DATAGRAM_BYTES = 4096
_NOBODY = bytes(16)  # an address of no family: connected to it, a socket is not connected any more
_DATAGRAMS_AT_ONCE = 64  # limit per call, so that a continuous sender cannot stall the process


class UdpLink(Endpoint):
    """A UDP socket, polled for `spin_s` before sleeping; only a `target`'s datagrams are received."""

    def __init__(self, sock: socket.socket, url: str, target: Address | None) -> None:
        super().__init__(url, target)
        sock.setblocking(False)
        self._socket = sock
        self._connected: Address | None = None  # saves a fifth of an exchange
        self.kept: Address | None = None
        self.spin_s = SPIN_S
        self._waited_s = 0.0
        if target is not None:
            self.speak_with(target)

    def speak_with(self, target: Address) -> None:
        self.target = target
        if ip_address(target[0]).is_loopback:  # other routes may change
            self._connect(target)
        self._opened = [target]

    def keep_to(self, peer: Address) -> None:
        """Have Linux drop what others send, so that no flood delays the peer's datagrams."""
        self.kept = peer
        if sys.platform == "linux":
            with suppress(OSError):
                self._connect(peer)

    def release(self) -> None:
        """Receive from everybody again."""
        self.kept = None
        if self._connected is not None:
            self._connected = None
            ctypes.CDLL(None).connect(self._socket.fileno(), _NOBODY, len(_NOBODY))

    def _connect(self, peer: Address) -> None:
        self._socket.connect(peer)
        self._connected = peer

    def send(self, datagram: bytes, address: Address | None = None) -> None:
        """Send or lose the datagram; raise `LinkError` if the target is unreachable."""
        destination = address or self.target
        assert destination is not None, "an endpoint that waits needs an address to send to"
        try:
            if destination == self._connected:
                self._socket.send(datagram)
            else:
                self._socket.sendto(datagram, destination)
        except (BlockingIOError, ConnectionRefusedError):
            return
        except OSError as error:
            if address is not None:
                return  # a sender may lie about where it is
            raise LinkError(f"cannot send to {destination[0]}:{destination[1]}: {error.strerror}") from error

    def receive(self, timeout_s: float) -> tuple[bytes, Address] | None:
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
                give_way()
        self._waited_s = perf_counter() - began_s
        return received

    def receive_now(self) -> list[tuple[bytes, Address]]:
        received = []
        for _ in range(_DATAGRAMS_AT_ONCE):
            try:
                datagram, sender = self._take()
            except ConnectionRefusedError:
                continue
            except BlockingIOError:
                break
            if self.target is None or sender == self.target:
                received.append((datagram, sender))
        return received

    def wait(self, timeout_s: float) -> None:
        select([self._socket], [], [], timeout_s)

    def close(self) -> None:
        self._socket.close()

    def _receive_now(self) -> tuple[bytes, Address] | None:
        try:
            if self._connected is not None:
                return self._socket.recv(_MAX_DATAGRAM_BYTES), self._connected
            datagram, sender = self._socket.recvfrom(_MAX_DATAGRAM_BYTES)
        except (BlockingIOError, ConnectionRefusedError):
            return None
        return (datagram, sender) if self.target is None or sender == self.target else None

    def _take(self) -> tuple[bytes, Address]:
        if self._connected is not None:
            return self._socket.recv(_MAX_DATAGRAM_BYTES), self._connected
        return self._socket.recvfrom(_MAX_DATAGRAM_BYTES)


def is_bound(address: Address) -> bool:
    """Whether a program of this computer has the address."""
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(address)
    except OSError as error:
        return error.errno == EADDRINUSE
    return False
