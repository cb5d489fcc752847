"""File transfer to clients that ask again, are lost, have many sessions, or ask for nothing that makes sense."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.mavlink.files import ftp
from colibri.mavlink.files.ftp import Ftp
from colibri.mavlink.files.ftp_wire import DATA_BYTES, Error, Opcode
from colibri.mavlink.files.memory import Memory
from colibri.mavlink.files.tree import Tree
from colibri.mavlink.node.service import Peer
from colibri.mavlink.wire.dialect import Codec
from tests.support.ftp_client import HEADER, OTHER, PEER, TEXT, Client, parsed


@pytest.mark.parametrize(
    ("opcode", "data"),
    [
        (Opcode.MAKE_FOLDER, b"d"),
        (Opcode.REMOVE, b"text"),
        (Opcode.RENAME, b"text\0other"),
        (Opcode.REMOVE_FOLDER, b"empty"),
    ],
)
def test_a_repeated_request_gets_the_remembered_answer(
    client: Client, memory: Memory, opcode: int, data: bytes
) -> None:
    memory.make_folder(("empty",))
    first = client.ask(opcode, data)
    assert client.send(opcode, data) == [first]
    assert first.opcode == Opcode.ACK
    assert client.ask(opcode, data).opcode == Opcode.NAK  # with another number it is another request
    client.now_us += ftp.REMEMBERED_FOR_US + 1
    client.sequence -= 1
    assert client.send(opcode, data)[0].opcode == Opcode.NAK


def test_a_file_is_not_emptied_by_a_repeated_request(client: Client, memory: Memory) -> None:
    client.do(Opcode.CREATE, b"new")
    created = client.sequence
    client.do(Opcode.WRITE, b"hello")
    client.sequence = created
    assert client.send(Opcode.CREATE, b"new")[0].opcode == Opcode.ACK
    assert memory.open(("new",)).size == 5  # type: ignore[union-attr]


def test_memory_is_bounded(service: Ftp) -> None:
    for number in range(1500):
        client = Client(service, Peer(number, number % 256, 1), number % 256)
        client.ask(Opcode.MAKE_FOLDER, b"%d" % number)
        client.ask(Opcode.CREATE, b"text")
        client.send(Opcode.BURST, size=1)
        client.send(Opcode.CHECKSUM, b"text")
    assert len(service._sessions) <= ftp.MAX_SESSIONS  # noqa: SLF001
    assert len(service._remembered) <= ftp.MAX_REMEMBERED  # noqa: SLF001
    assert len(service._bursts) <= ftp.MAX_SESSIONS  # noqa: SLF001
    assert len(service._checksums) <= ftp.MAX_SESSIONS  # noqa: SLF001


def test_every_client_has_its_own_sessions(service: Ftp, memory: Memory) -> None:
    memory.create(("other",))
    memory.write(("other",), 0, b"other")
    one, two = Client(service), Client(service, OTHER)
    one.do(Opcode.OPEN_TO_READ, b"text")
    two.do(Opcode.OPEN_TO_READ, b"other")
    assert one.do(Opcode.READ, size=5) == TEXT[:5]
    assert two.do(Opcode.READ, size=5) == b"other"
    two.do(Opcode.RESET)
    assert one.do(Opcode.READ, size=5) == TEXT[:5]
    assert two.ask(Opcode.READ, size=5).error == Error.INVALID_SESSION


def test_a_client_may_have_several_sessions_but_not_too_many(service: Ftp) -> None:
    for session in range(ftp.MAX_SESSIONS_OF_A_PEER):
        Client(service, PEER, session).do(Opcode.OPEN_TO_READ, b"text")
    full = Client(service, PEER, 200)
    assert full.ask(Opcode.OPEN_TO_READ, b"text").error == Error.NO_SESSIONS
    assert full.ask(Opcode.CREATE, b"never").error == Error.NO_SESSIONS
    assert b"Fnever\t0" not in full.listed(b"/")
    Client(service, OTHER).do(Opcode.OPEN_TO_READ, b"text")
    Client(service, PEER, 3).do(Opcode.TERMINATE)
    full.do(Opcode.OPEN_TO_READ, b"text")


def test_an_idle_session_ends(client: Client) -> None:
    client.do(Opcode.OPEN_TO_READ, b"text")
    client.now_us += ftp.SESSION_ENDS_AFTER_US
    client.do(Opcode.READ, size=1)
    client.now_us += ftp.SESSION_ENDS_AFTER_US + 1
    assert client.ask(Opcode.READ, size=1).error == Error.INVALID_SESSION


def test_only_an_idle_session_is_taken_over(client: Client) -> None:
    client.do(Opcode.OPEN_TO_READ, b"text")
    client.do(Opcode.OPEN_TO_READ, b"text")  # the answer was lost, and MAVSDK asks with another number
    assert client.ask(Opcode.OPEN_TO_READ, b"@PARAM/param.pck").error == Error.NO_SESSIONS
    assert client.ask(Opcode.CREATE, b"new").error == Error.NO_SESSIONS
    assert b"Fnew\t0" not in client.listed(b"/")
    assert client.do(Opcode.READ, size=3) == TEXT[:3]
    client.now_us += ftp.TAKEN_OVER_AFTER_US
    client.do(Opcode.CREATE, b"new")
    client.do(Opcode.WRITE, b"x")


def test_a_session_is_ended_as_often_as_it_is_asked_for(client: Client) -> None:
    """MAVSDK fails a download that is complete if the end, asked for again after a lost answer, is refused."""
    client.do(Opcode.OPEN_TO_READ, b"text")
    assert client.do(Opcode.TERMINATE) == client.do(Opcode.TERMINATE) == b""


def test_numbers_go_round(client: Client) -> None:
    client.sequence = 0xFFFD
    client.do(Opcode.OPEN_TO_READ, b"text")
    client.sequence = 0xFFFE
    assert [reply.sequence for reply in client.burst(0, 239)][:3] == [0, 1, 2]


PATHS = st.sampled_from([b"", b"text", b"d", b"d/e", b"logs", b"logs/x", b"@PARAM/param.pck", b"..", b"a\0b", b"\xff"])
REQUESTS = st.one_of(
    st.binary(max_size=251),
    st.builds(
        lambda sequence, session, opcode, size, offset, data: (
            HEADER.pack(sequence, session, opcode, min(size, 255), 0, 0, 0, offset) + data
        ),
        st.integers(0, 3),
        st.integers(0, 2),
        st.integers(0, 18),
        st.one_of(st.integers(0, 12), st.integers(0, 255)),
        st.one_of(st.integers(0, 20), st.integers(0, 0xFFFFFFFF)),
        st.one_of(PATHS, st.binary(max_size=239)),
    ),
)


@given(st.lists(st.tuples(REQUESTS, st.sampled_from([PEER, OTHER]), st.integers(0, 30_000_000)), max_size=60))
def test_nothing_that_is_asked_raises(requests: list[tuple[bytes, Peer, int]]) -> None:
    memory = Memory()
    memory.create(("text",))
    service = Ftp(Tree(memory, {"logs": Memory()}, {"@PARAM/param.pck": lambda query: query.encode()}))
    codec = Codec(255, 190)
    now_us = 0
    for payload, peer, later_us in requests:
        now_us += later_us
        (message,) = codec.decode(codec.encode("FILE_TRANSFER_PROTOCOL", 0, 1, 1, payload.ljust(251, b"\0")))
        for send in (*service.receive(message, peer, now_us), *service.poll(now_us)):
            reply = parsed(send)
            assert reply.opcode in (Opcode.ACK, Opcode.NAK)
            assert reply.size <= DATA_BYTES
            if reply.opcode == Opcode.NAK:
                assert reply.error in set(Error)
