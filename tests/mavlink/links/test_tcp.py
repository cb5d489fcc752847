"""TCP endpoints on real sockets of the loopback interface."""

import socket
from collections.abc import Callable, Iterator
from contextlib import closing
from time import perf_counter, sleep
from typing import TypeVar

import pytest

from colibri.common.types import Address
from colibri.mavlink.links import tcp
from colibri.mavlink.links.link import GroundLink
from colibri.mavlink.links.open import open_ground_link
from colibri.mavlink.wire.dialect import Codec

T = TypeVar("T")
HEARTBEAT = Codec(255, 190).encode("HEARTBEAT", 6, 8, 0, 0, 4, 3)
TEXT = Codec(255, 190).encode("STATUSTEXT", 6, b"x" * 50, 0, 0)


def awaited(look: Callable[[], T], timeout_s: float = 5.0) -> T:
    give_up_s = perf_counter() + timeout_s
    while not (seen := look()) and perf_counter() < give_up_s:
        sleep(0.001)
    return seen


@pytest.fixture
def server() -> Iterator[GroundLink]:
    with closing(open_ground_link("tcpin:127.0.0.1:0")) as link:
        yield link


def port_of(link: GroundLink) -> int:
    return int(link.url.rpartition(":")[2])


def caller(server: GroundLink) -> socket.socket:
    return socket.create_connection(("127.0.0.1", port_of(server)), timeout=5.0)


def exchange(client: GroundLink, server: GroundLink) -> Address:
    def look() -> list[tuple[bytes, Address]]:
        client.send(HEARTBEAT)
        return server.receive_now()

    received = awaited(look)
    assert received[0][0] == HEARTBEAT
    return received[0][1]


def test_several_clients_are_told_apart(server: GroundLink) -> None:
    with caller(server) as one, caller(server) as two:
        one.sendall(HEARTBEAT)
        ((_, first),) = awaited(server.receive_now)
        two.sendall(HEARTBEAT)
        ((_, second),) = awaited(server.receive_now)
        assert (first, second) == (one.getsockname(), two.getsockname())
        server.send(TEXT, second)
        assert two.recv(1000) == TEXT
        server.send(HEARTBEAT, first)
        assert one.recv(1000) == HEARTBEAT


def test_half_a_frame_waits_for_its_own_client(server: GroundLink) -> None:
    with caller(server) as one, caller(server) as two:
        one.sendall(b"noise" + TEXT[:20])
        two.sendall(HEARTBEAT[:5])
        sleep(0.05)
        assert server.receive_now() == []
        two.sendall(HEARTBEAT[5:])
        assert awaited(server.receive_now) == [(HEARTBEAT, two.getsockname())]
        one.sendall(TEXT[20:] + HEARTBEAT)
        assert awaited(server.receive_now) == [(TEXT, one.getsockname()), (HEARTBEAT, one.getsockname())]


def test_a_silent_client_can_be_sent_to(server: GroundLink) -> None:
    with caller(server) as client:

        def opened() -> list[Address]:
            server.receive_now()
            return server.take_opened()

        assert awaited(opened) == [client.getsockname()]
        assert server.take_opened() == []
        server.send(TEXT, client.getsockname())
        assert client.recv(1000) == TEXT


def test_a_client_that_has_gone_is_forgotten(server: GroundLink) -> None:
    with caller(server) as client:
        client.sendall(HEARTBEAT)
        awaited(server.receive_now)
        address = client.getsockname()
        assert server.take_closed() == []

    def look() -> list[Address]:
        server.receive_now()
        return server.take_closed()

    assert awaited(look) == [address]
    assert server.take_closed() == []
    server.send(TEXT, address)


def test_a_connection_that_is_reset_is_no_error(server: GroundLink) -> None:
    client = caller(server)
    client.sendall(HEARTBEAT)
    ((_, address),) = awaited(server.receive_now)
    client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
    client.close()

    def look() -> list[Address]:
        server.send(TEXT, address)
        return server.take_closed()

    assert awaited(look) == [address]


def test_a_slow_reader_loses_whole_frames_and_blocks_nobody(server: GroundLink) -> None:
    with caller(server) as slow:
        slow.sendall(HEARTBEAT)
        ((_, address),) = awaited(server.receive_now)
        codec = Codec(1, 1)
        sent = [codec.encode("STATUSTEXT", 6, b"%08d" % i + b"x" * 42, 0, 0) for i in range(150_000)]
        max_s = 0.0
        for frame in sent:
            began_s = perf_counter()
            server.send(frame, address)
            max_s = max(max_s, perf_counter() - began_s)
        assert max_s < 0.5
        stream = bytearray()
        slow.setblocking(False)

        def look() -> bool:
            server.receive_now()  # sends on what waits
            try:
                stream.extend(slow.recv(1 << 20))
            except BlockingIOError:
                return True
            return False

        quiet = 0
        while quiet < 20:
            quiet = quiet + 1 if look() else 0
            sleep(0.001 if quiet else 0.0)
        assert len(stream) % len(sent[0]) == 0
        assert 0 < len(stream) < sum(map(len, sent))
        assert stream == b"".join(sent[: len(stream) // len(sent[0])])  # what is dropped is dropped at the end
        server.send(TEXT, address)
        slow.settimeout(5.0)
        assert slow.recv(1000) == TEXT


def test_a_client_calls_again(server: GroundLink, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tcp, "RECONNECT_AFTER_S", 0.01)
    url, port = server.url, port_of(server)
    with closing(open_ground_link(url.replace("tcpin", "tcp"))) as client:
        exchange(client, server)
        assert client.take_opened() == [client.target]
        server.close()

        def closed() -> list[Address]:
            client.receive_now()
            return client.take_closed()

        assert awaited(closed) == [("127.0.0.1", port)]
        for _ in range(20):
            client.send(HEARTBEAT)
            client.receive_now()
            sleep(0.002)
        with closing(open_ground_link(url)) as again:
            exchange(client, again)
            assert client.take_opened() == [client.target]
            assert client.take_opened() == []


def test_a_sleeping_server_is_woken_by_a_new_client(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tcp, "perf_counter", lambda: 10.0)
    with closing(open_ground_link("tcpin:127.0.0.1:0")) as server, caller(server) as one:
        one.sendall(HEARTBEAT)
        awaited(server.receive_now)
        with caller(server) as two:
            server.wait(5.0)
            server.receive_now()
            assert server.take_opened() == [one.getsockname(), two.getsockname()]


@pytest.fixture
def now_s(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now = [100.0]
    monkeypatch.setattr(tcp, "perf_counter", lambda: now[0])
    return now


def enter(server: GroundLink, now_s: list[float], *, speaks: bool) -> socket.socket:
    client = caller(server)
    now_s[0] += tcp.ACCEPT_EVERY_S
    if speaks:
        client.sendall(HEARTBEAT)
    awaited(lambda: server.receive_now() if speaks else server.receive_now() or True)
    return client


@pytest.mark.parametrize(("silent", "waits_s", "leaves"), [
    ((0,), 0.0, 0),  # who never spoke goes first
    ((0, 1), 0.0, 0),
    ((), tcp.IDLE_AFTER_S, 0),  # then who has been silent for longest
    ((), 0.0, 2),  # among active ones there is no room
])  # fmt: skip
def test_idle_clients_give_way(
    server: GroundLink,
    now_s: list[float],
    monkeypatch: pytest.MonkeyPatch,
    silent: tuple[int, ...],
    waits_s: float,
    leaves: int,
) -> None:
    monkeypatch.setattr(tcp, "CONNECTIONS", 2)
    clients = [enter(server, now_s, speaks=number not in silent) for number in range(2)]
    now_s[0] += waits_s
    clients.append(enter(server, now_s, speaks=False))
    assert clients[leaves].recv(10) == b""
    (note,) = server.take_notes()
    assert ("turned away" if leaves == 2 else "another client waits") in note
    for client in clients:
        client.close()


@pytest.mark.parametrize(("first", "why"), [
    ([b"POST / HTTP/1.1\r\nHost: 127.0.0.1:5760\r\nContent-Length: 21\r\n\r\n"], "speaks HTTP"),
    ([b"PO", b"ST", b" / HTTP/1.1\r\n", b"\r\n"], "speaks HTTP"),
    ([b"FLY /" + b"x" * 90, b"x HTTP/1.1\r\n\r\n"], "speaks HTTP"),
    ([b"\r\nget /\r\n"], "speaks HTTP"),
    ([b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"], "speaks HTTP"),
    ([b"\x16\x03\x01\x02\x00\x01\x00"], "speaks TLS"),
    ([b"x" * 4096], "speaks no MAVLink"),
])  # fmt: skip
def test_web_pages_are_disconnected(server: GroundLink, first: list[bytes], why: str) -> None:
    with caller(server) as page, caller(server) as station:
        for part in first[:-1]:
            page.sendall(part)
            awaited(lambda: server.receive_now() or True)
        page.sendall(first[-1] + HEARTBEAT)

        def closed() -> list[Address]:
            assert server.receive_now() == []
            return server.take_closed()

        assert awaited(closed) == [page.getsockname()]
        (note,) = server.take_notes()
        assert why in note
        station.sendall(HEARTBEAT)
        assert awaited(server.receive_now) == [(HEARTBEAT, station.getsockname())]


def test_a_port_is_free_again_at_once(server: GroundLink) -> None:
    with caller(server) as client:
        client.sendall(HEARTBEAT)
        awaited(server.receive_now)
        server.close()
        open_ground_link(server.url).close()


@pytest.mark.parametrize("scheme", ["udpin", "udpout", "tcpin", "tcp"])
def test_closed_twice_is_closed(scheme: str) -> None:
    link = open_ground_link(f"{scheme}:127.0.0.1:{0 if scheme.endswith('in') else 9}")
    link.close()
    link.close()
