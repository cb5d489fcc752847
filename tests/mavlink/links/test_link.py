import sys
from collections.abc import Iterator
from contextlib import closing

import pytest

from colibri.mavlink.links.link import LinkError
from colibri.mavlink.links.open import beyond_loopback, open_ground_link, open_link, unsigned_refusal
from colibri.mavlink.links.udp import UdpLink, is_bound

TIMEOUT_S = 2.0


@pytest.fixture
def server() -> Iterator[UdpLink]:
    with closing(open_link("udpin:127.0.0.1:0")) as link:
        yield link


def client_of(server: UdpLink) -> UdpLink:
    return open_link(server.url.replace("udpin", "udpout"))


def test_an_outgoing_endpoint_hears_nobody_but_its_target(server: UdpLink) -> None:
    with closing(client_of(server)) as client, closing(open_link("udpin:127.0.0.1:0")) as stranger:
        client.send(b"hello")
        received = server.receive(TIMEOUT_S)
        assert received is not None
        stranger.send(b"from a stranger", received[1])
        server.send(b"from the target", received[1])
        answers = [client.receive(TIMEOUT_S), client.receive(0.0)]
        assert [answer[0] for answer in answers if answer] == [b"from the target"]


def test_silence_is_none(server: UdpLink) -> None:
    assert server.receive(0.0) is None
    assert server.receive(0.01) is None


def test_a_target_that_does_not_listen_is_no_error(server: UdpLink) -> None:
    client = client_of(server)
    server.close()
    with closing(client):
        for _ in range(3):
            client.send(b"anybody?")
            assert client.receive(0.001) is None


@pytest.mark.parametrize(
    "url",
    ["", "udpin", "udpin:127.0.0.1", "udpin::14560", "tcp:127.0.0.1:5760", "udpin:127.0.0.1:70000", "udpin:a:b",
     "udpout:127.0.0.1:0", "udpout:127.0.0.1:-1"],
)  # fmt: skip
def test_a_malformed_url_is_refused(url: str) -> None:
    with pytest.raises(LinkError, match=r"port 0|expected udpin"):
        open_link(url)


def test_a_sender_that_cannot_be_answered_is_no_error(server: UdpLink) -> None:
    server.send(b"who lies about its port", ("127.0.0.1", 0))


def test_all_that_has_come_is_received_at_once_with_its_senders(server: UdpLink) -> None:
    assert server.receive_now() == []
    with closing(client_of(server)) as one, closing(client_of(server)) as two:
        for i in range(3):
            one.send(b"one%d" % i)
            two.send(b"two%d" % i)
        received = server.receive_now()
        assert sorted(datagram for datagram, _ in received) == [b"one0", b"one1", b"one2", b"two0", b"two1", b"two2"]
        for datagram, sender in received:
            server.send(datagram, sender)
        assert [datagram for datagram, _ in one.receive_now()] == [b"one0", b"one1", b"one2"]
        assert [datagram for datagram, _ in two.receive_now()] == [b"two0", b"two1", b"two2"]


def test_whoever_sends_without_a_pause_does_not_hold_up(server: UdpLink) -> None:
    with closing(client_of(server)) as client:
        for _ in range(100):
            client.send(b"again")
        assert 0 < len(server.receive_now()) < 100
        assert len(server.receive_now()) > 0


def test_a_target_that_does_not_listen_is_heard_from_later(server: UdpLink) -> None:
    client = client_of(server)
    server.close()
    with closing(client):
        client.send(b"anybody?", client.target)
        assert client.receive_now() == []
        assert client.take_opened() == [client.target]
        assert client.take_opened() == client.take_closed() == []


@pytest.mark.parametrize(
    ("url", "beyond"),
    [
        ("udpin:127.0.0.1:14550", False),
        ("tcpin:127.0.0.9:5760", False),
        ("udpout:localhost:14550", False),
        ("udpin:0.0.0.0:14550", True),
        ("tcpin:0.0.0.0:5760", True),
        ("tcp:192.168.1.7:5760", True),
        ("udpout:10.0.0.255:14550", True),
    ],
)
def test_what_reaches_beyond_loopback(url: str, beyond: bool) -> None:
    assert beyond_loopback(url) is beyond
    assert url in unsigned_refusal(url)


@pytest.mark.parametrize("url", ["", "tcp:127.0.0.1:0", "tcp:127.0.0.1", "tcpin:a b:1"])
def test_a_malformed_url_of_a_ground_station_is_refused(url: str) -> None:
    for function in (open_ground_link, beyond_loopback):
        with pytest.raises(LinkError, match=r"port 0|expected udpin:HOST:PORT or .* or tcp:HOST:PORT|unknown host"):
            function(url)


def test_an_address_is_bound_while_its_socket_is_open(server: UdpLink) -> None:
    with closing(client_of(server)) as client:
        client.send(b"hello")
        received = server.receive(1.0)
        assert received is not None
        assert is_bound(received[1])
    assert not is_bound(received[1])
    assert not is_bound(("192.0.2.1", 14550))


@pytest.mark.skipif(sys.platform != "linux", reason="sockets are connected to a caller on Linux only")
def test_a_link_kept_to_a_peer_drops_what_others_send(server: UdpLink) -> None:
    with closing(client_of(server)) as peer, closing(client_of(server)) as stranger:
        peer.send(b"peer")
        received = server.receive(1.0)
        assert received is not None
        for _ in range(2):
            server.keep_to(received[1])
            stranger.send(b"flood")
            peer.send(b"again")
            assert server.receive(1.0) == (b"again", received[1])
            assert server.receive(0.0) is None
            server.release()
            for _ in range(2):  # the first meets the refusal of the one before
                stranger.send(b"call")
            assert server.receive_now()[0][0] == b"call"
