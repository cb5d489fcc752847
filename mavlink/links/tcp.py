"""Non-blocking TCP endpoints for whole frames. A slow reader loses frames, as over UDP.

Any web page can have the browser post bytes to a port of this computer. So nothing is read from a stream that begins
like HTTP or TLS, or that brings no frame in its first `FIRST_BYTES`.
"""

import re
import select
import socket
from time import perf_counter

from colibri.common.types import Address
from colibri.mavlink.links.link import Endpoint
from colibri.mavlink.wire.framing import Framer

OUTPUT_BYTES = 1 << 18  # send queue per connection beyond the system's; more is dropped
CONNECTIONS = 16  # limit of a server's clients
RECONNECT_AFTER_S = 1.0
IDLE_AFTER_S = 3.5  # silence after which a client gives way to another; stations send a HEARTBEAT a second
FIRST_BYTES = 4096
NOTE_EVERY_S = 1.0  # interval of the notes on refused connections: a flood must not fill the terminal
ACCEPT_EVERY_S = 0.1  # interval of accepting clients while others are served: each attempt is a system call
_CHUNK_BYTES = 4096
_CHUNKS_AT_ONCE = 16  # limit per call, so that a continuous sender cannot stall the process
_HTTP = re.compile(
    rb"\s*(?:GET|HEAD|POST|PUT|DELETE|CONNECT|OPTIONS|TRACE|PATCH|PRI) |\s*[!-~]+ +[!-~]+ +HTTP/|HTTP/\d", re.IGNORECASE
)
_TLS = re.compile(rb"\x16\x03")


class Connection:
    """A connected socket; `refused` says what its stream is instead of MAVLink."""

    def __init__(self, sock: socket.socket, address: Address) -> None:
        sock.setblocking(False)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket = sock
        self._framer = Framer()
        self._pending = bytearray()
        self._head: bytes | None = b""  # of the stream, until its first frame
        self.address = address
        self.alive = True
        self.refused = ""
        self.spoke_s: float | None = None

    def send(self, datagram: bytes) -> None:
        if len(self._pending) + len(datagram) > OUTPUT_BYTES:
            return
        self._pending += datagram
        self.flush()

    def fileno(self) -> int:
        return self._socket.fileno()

    def flush(self) -> None:
        try:
            while self._pending and self.alive:
                del self._pending[: self._socket.send(self._pending)]
        except BlockingIOError:
            return
        except OSError:
            self.close()

    def receive_now(self) -> list[bytes]:
        self.flush()
        frames: list[bytes] = []
        for _ in range(_CHUNKS_AT_ONCE if self.alive else 0):
            try:
                chunk = self._socket.recv(_CHUNK_BYTES)
            except BlockingIOError:
                break
            except OSError:
                chunk = b""
            if not chunk:
                self.close()
                break
            taken = self._framer.take(chunk)
            if self._head is not None and not self._begins_well(chunk, taken):
                self.close()
                return []
            frames += taken
            if len(chunk) < _CHUNK_BYTES:
                break
        if frames:
            self.spoke_s = perf_counter()
        return frames

    def _begins_well(self, chunk: bytes, frames: list[bytes]) -> bool:
        assert self._head is not None, "asked until the first frame"
        self._head += chunk
        if _HTTP.match(self._head):
            self.refused = "speaks HTTP, as a web page does"
        elif _TLS.match(self._head):
            self.refused = "speaks TLS, as a browser does"
        elif not frames and len(self._head) >= FIRST_BYTES:
            self.refused = "speaks no MAVLink"
        if frames:
            self._head = None
        return not self.refused

    def close(self) -> None:
        self.alive = False
        self._socket.close()


class TcpServer(Endpoint):
    def __init__(self, sock: socket.socket, url: str) -> None:
        super().__init__(url, None)
        sock.setblocking(False)
        self._socket = sock
        self._connections: dict[Address, Connection] = {}
        self._accept_at_s = self._note_at_s = 0.0

    def send(self, datagram: bytes, address: Address | None = None) -> None:
        for connection in list(self._connections.values()):
            if address is None or connection.address == address:
                connection.send(datagram)
        self._forget_dead()

    def receive_now(self) -> list[tuple[bytes, Address]]:
        if not self._connections or perf_counter() >= self._accept_at_s:
            self._accept()
        connections = self._connections.values()
        received = [(frame, each.address) for each in connections for frame in each.receive_now()]
        self._forget_dead()
        return received

    def wait(self, timeout_s: float) -> None:
        sockets = [self._socket.fileno(), *(connection.fileno() for connection in self._connections.values())]
        if self._socket.fileno() in select.select(sockets, [], [], timeout_s)[0]:
            self._accept_at_s = 0.0

    def close(self) -> None:
        for connection in self._connections.values():
            connection.close()
        self._connections.clear()
        self._socket.close()

    def _accept(self) -> None:
        self._accept_at_s = perf_counter() + ACCEPT_EVERY_S
        for _ in range(CONNECTIONS):
            try:
                sock, address = self._socket.accept()
            except OSError:  # nobody, gone again, or no descriptors left
                return
            connection = _established(sock, address) if self._has_room() else None
            if connection is None:
                sock.close()
            else:
                self._connections[address] = connection
                self._opened.append(address)

    def _has_room(self) -> bool:
        """Make room for a client if needed: the one that never spoke, or is silent for longest, goes."""
        if len(self._connections) < CONNECTIONS:
            return True
        idle = min(self._connections.values(), key=lambda connection: connection.spoke_s or 0.0)
        if idle.spoke_s is not None and perf_counter() < idle.spoke_s + IDLE_AFTER_S:
            self._note(f"a client was turned away: {CONNECTIONS} others are active")
            return False
        self._note(f"{_named(idle.address)} was disconnected: it is silent, and another client waits")
        idle.close()
        self._forget_dead()
        return True

    def _forget_dead(self) -> None:
        for connection in [connection for connection in self._connections.values() if not connection.alive]:
            del self._connections[connection.address]
            self._closed.append(connection.address)
            if connection.refused:
                self._note(f"{_named(connection.address)} was disconnected: it {connection.refused}")

    def _note(self, text: str) -> None:
        now_s = perf_counter()
        if now_s >= self._note_at_s:
            self._note_at_s = now_s + NOTE_EVERY_S
            self._notes.append(f"{self.url}: {text}")


class TcpClient(Endpoint):
    """A client that reconnects `RECONNECT_AFTER_S` after a failure or the end of its connection."""

    target: Address

    def __init__(self, url: str, target: Address) -> None:
        super().__init__(url, target)
        self._socket: socket.socket | None = None
        self._connection: Connection | None = None
        self._call_again_s = 0.0
        self._call()

    def send(self, datagram: bytes, address: Address | None = None) -> None:
        connection = self._connected()
        if connection and address in (None, self.target):
            connection.send(datagram)
            self._notice_end(connection)

    def receive_now(self) -> list[tuple[bytes, Address]]:
        connection = self._connected()
        if connection is None:
            return []
        received = [(frame, self.target) for frame in connection.receive_now()]
        self._notice_end(connection)
        return received

    def wait(self, timeout_s: float) -> None:
        if self._connection is not None:
            select.select([self._connection], [], [], timeout_s)
        else:
            select.select([], [] if self._socket is None else [self._socket], [], min(timeout_s, RECONNECT_AFTER_S))

    def close(self) -> None:
        self._hang_up()
        self._call_again_s = float("inf")

    def _connected(self) -> Connection | None:
        if self._connection is not None:
            return self._connection
        if self._socket is None:
            if perf_counter() >= self._call_again_s:
                self._call()
        elif select.select([], [self._socket], [], 0.0)[1]:
            self._connection = _established(self._socket, self.target)
            if self._connection is None:
                self._hang_up()
            else:
                self._opened.append(self.target)
        return self._connection

    def _notice_end(self, connection: Connection) -> None:
        if not connection.alive:
            if connection.refused and not self._notes:
                self._notes.append(f"{self.url}: disconnected: the server {connection.refused}")
            self._hang_up()
            self._closed.append(self.target)

    def _call(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._socket.setblocking(False)
        try:
            self._socket.connect(self.target)
        except BlockingIOError:
            return
        except OSError:
            self._hang_up()

    def _hang_up(self) -> None:
        if self._socket is not None:
            self._socket.close()
        self._socket = self._connection = None
        self._call_again_s = perf_counter() + RECONNECT_AFTER_S


def _named(address: Address) -> str:
    return f"{address[0]}:{address[1]}"


def _established(sock: socket.socket, address: Address) -> Connection | None:
    """Return the connection of a completed call, unless it failed or connected to itself, as to an unused own port."""
    try:
        if sock.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR) or sock.getsockname() == sock.getpeername():
            return None
        return Connection(sock, address)
    except OSError:
        return None
