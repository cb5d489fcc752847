"""A UDP endpoint with bounded blocking."""

import ctypes
import socket
import sys
from contextlib import suppress
from errno import EADDRINUSE
from ipaddress import ip_address
from select import select
from struct import Struct
from time import perf_counter

from colibri.common.types import Address
from colibri.mavlink.links.link import SPIN_S, Endpoint, LinkError, give_way

_MAX_DATAGRAM_BYTES = 4096
_ATTACH_FILTER, _DETACH_FILTER = 26, 27  # options of Linux's sockets
_INSTRUCTION, _PROGRAM = Struct("=HBBI"), Struct("@HP")
_DATAGRAMS_AT_ONCE = 64  # limit per call, so that a continuous sender cannot stall the process


class UdpLink(Endpoint):
    """A UDP socket, polled for `spin_s` before sleeping; only a `target`'s datagrams are received."""

    def __init__(self, sock: socket.socket, url: str, target: Address | None) -> None:
        super().__init__(url, target)
        sock.setblocking(False)
        self._socket = sock
        self._connected = False
        self.kept: Address | None = None
        self.spin_s = SPIN_S
        self._waited_s = 0.0
        if target is not None:
            self.speak_with(target)

    def speak_with(self, target: Address) -> None:
        self.target = target
        self._connected = ip_address(target[0]).is_loopback
        if self._connected:  # saves a fifth of an exchange; other routes may change
            self._socket.connect(target)
        self._opened = [target]

    def keep_to(self, peer: Address) -> None:
        """Have Linux drop other ports' datagrams, so that no flood delays the peer's."""
        self.kept = peer
        if sys.platform == "linux":
            load_port, is_peers = (0x28, 0, 0, 0), (0x15, 0, 1, peer[1])
            accept, drop = (0x06, 0, 0, 0xFFFFFFFF), (0x06, 0, 0, 0)
            code = b"".join(_INSTRUCTION.pack(*each) for each in (load_port, is_peers, accept, drop))
            memory = ctypes.create_string_buffer(code, len(code))
            program = _PROGRAM.pack(4, ctypes.addressof(memory))
            with suppress(OSError):
                self._socket.setsockopt(socket.SOL_SOCKET, _ATTACH_FILTER, program)

    def release(self) -> None:
        """Receive from everybody again."""
        self.kept = None
        if sys.platform == "linux":
            with suppress(OSError):
                self._socket.setsockopt(socket.SOL_SOCKET, _DETACH_FILTER, 0)

    def send(self, datagram: bytes, address: Address | None = None) -> None:
        """Send or lose the datagram; raise `LinkError` if the target is unreachable."""
        destination = address or self.target
        assert destination is not None, "an endpoint that waits needs an address to send to"
        try:
            if self._connected and destination == self.target:
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
            datagram, sender = self._take()
        except (BlockingIOError, ConnectionRefusedError):
            return None
        if self.target is not None and sender != self.target:
            return None
        return datagram, sender

    def _take(self) -> tuple[bytes, Address]:
        if self._connected:
            assert self.target is not None, "only with a target is a socket connected"
            return self._socket.recv(_MAX_DATAGRAM_BYTES), self.target
        return self._socket.recvfrom(_MAX_DATAGRAM_BYTES)


def is_bound(address: Address) -> bool:
    """Whether a program of this computer has the address."""
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(address)
    except OSError as error:
        return error.errno == EADDRINUSE
    return False
