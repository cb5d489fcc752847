"""FTP requests and their answers: files, folders, bursts, checksums and repeats."""

import random
from zlib import crc32

import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.mavlink.files import ftp
from colibri.mavlink.files.ftp import Ftp
from colibri.mavlink.files.ftp_wire import DATA_BYTES, FtpError, Opcode
from colibri.mavlink.files.memory import MemoryFiles
from colibri.mavlink.files.tree import Tree
from colibri.mavlink.node.service import Peer
from colibri.mavlink.wire.dialect import Codec
from tests.support.ftp_client import HEADER, OTHER, PEER, TEXT, Client, parsed


def test_a_file_is_read(client: Client) -> None:
    assert int.from_bytes(client.do(Opcode.OPEN_TO_READ, b"/text"), "little") == len(TEXT)
    assert client.do(Opcode.READ, offset=10, size=20) == TEXT[10:30]
    assert client.do(Opcode.READ, offset=len(TEXT) - 5, size=DATA_BYTES) == TEXT[-5:]
    assert client.do(Opcode.READ, offset=3, size=0) == TEXT[3 : 3 + DATA_BYTES]
    past = client.ask(Opcode.READ, offset=len(TEXT), size=1)
    assert (past.error, past.offset) == (FtpError.END_OF_FILE, len(TEXT))
    assert client.do(Opcode.TERMINATE) == b""
    assert client.ask(Opcode.READ, size=1).error == FtpError.INVALID_SESSION


@pytest.mark.parametrize("path", [b"text", b"/text", b"//./text", b"/text\0", b"/text\0garbage"])
def test_a_path_may_be_said_in_several_ways(client: Client, path: bytes) -> None:
    assert client.ask(Opcode.OPEN_TO_READ, path).opcode == Opcode.ACK


def test_a_path_may_have_a_query(client: Client) -> None:
    client.do(Opcode.OPEN_TO_READ, b"@PARAM/param.pck?withdefaults=1")
    assert client.do(Opcode.READ, size=100) == b"Qwithdefaults=1"


@pytest.mark.parametrize("size", [DATA_BYTES, 80, 1])
@pytest.mark.parametrize("length", [0, 1, 80, 160, DATA_BYTES, 2 * DATA_BYTES, 1000])
def test_a_burst_brings_the_rest_of_a_file(client: Client, memory: MemoryFiles, size: int, length: int) -> None:
    memory.truncate(("text",), length)
    client.do(Opcode.OPEN_TO_READ, b"text")
    replies = client.burst(0, size)
    if length == 0:
        assert [reply.error for reply in replies] == [FtpError.END_OF_FILE]
        return
    assert b"".join(reply.data for reply in replies) == TEXT[:length]
    assert [reply.sequence for reply in replies] == [client.sequence + 1 + number for number in range(len(replies))]
    assert [reply.offset for reply in replies] == list(range(0, length, size))
    assert [reply.burst_complete for reply in replies] == [0] * (len(replies) - 1) + [1]
    assert {reply.req_opcode for reply in replies} == {Opcode.BURST}


def test_bursts_of_several_clients_share_the_pace(service: Ftp) -> None:
    clients = [Client(service, Peer(number, 1, number)) for number in range(20)]
    for client in clients:
        client.do(Opcode.OPEN_TO_READ, b"text")
        client.send(Opcode.BURST, size=10)
    served = [send.channel for _ in range(5) for send in service.poll(0)]
    assert len(served) == 5 * ftp.BURST_PACKETS_A_POLL
    assert set(served) == set(range(20))


def test_a_client_that_is_gone_is_not_sent_a_large_file(client: Client, memory: MemoryFiles) -> None:
    memory.write(("text",), 4_000_000, b"x")
    client.do(Opcode.OPEN_TO_READ, b"text")
    replies = client.burst(0, DATA_BYTES)
    assert len(replies) == ftp.MAX_BURST_PACKETS
    assert replies[-1].burst_complete
    assert len(replies[-1].data) == DATA_BYTES  # a shorter one would mean the end of the file
    assert client.poll() == []


@pytest.mark.parametrize("opcode", [Opcode.TERMINATE, Opcode.RESET, Opcode.OPEN_TO_READ])
def test_a_burst_ends_with_its_session(client: Client, opcode: int) -> None:
    client.do(Opcode.OPEN_TO_READ, b"text")
    client.send(Opcode.BURST, size=1)
    assert client.poll()
    client.do(opcode, b"text" if opcode == Opcode.OPEN_TO_READ else b"")
    assert client.poll() == []


def test_a_file_that_is_cut_while_it_is_read_ends(client: Client, memory: MemoryFiles) -> None:
    client.do(Opcode.OPEN_TO_READ, b"text")
    client.send(Opcode.BURST, size=100)
    client.poll()
    memory.truncate(("text",), 850)
    (last,) = client.poll()
    assert (last.offset, last.size, last.burst_complete) == (800, 50, 1)
    client.send(Opcode.BURST, size=100)
    memory.remove(("text",))
    (gone,) = client.poll()
    assert gone.error == FtpError.NOT_FOUND
    assert client.poll() == []


def test_a_file_is_written(client: Client, memory: MemoryFiles) -> None:
    assert client.do(Opcode.CREATE, b"new") == b""
    second = client.ask(Opcode.WRITE, b"world", offset=6)
    assert (second.opcode, second.offset, second.size) == (Opcode.ACK, 6, 0)  # MAVProxy tells the parts by the offset
    client.do(Opcode.WRITE, b"hello ", offset=0)
    client.do(Opcode.TERMINATE)
    assert client.ask(Opcode.WRITE, b"x").error == FtpError.INVALID_SESSION
    client.do(Opcode.OPEN_TO_WRITE, b"new")
    client.do(Opcode.WRITE, b"H", offset=0)
    assert memory.open(("new",)).read(0, 100) == b"Hello world"
    client.do(Opcode.CREATE, b"new")
    assert memory.open(("new",)).size == 0


def test_what_is_open_to_read_is_not_written_and_the_reverse(client: Client) -> None:
    client.do(Opcode.OPEN_TO_READ, b"text")
    assert client.ask(Opcode.WRITE, b"x").error == FtpError.PROTECTED
    client.do(Opcode.TERMINATE)
    client.do(Opcode.OPEN_TO_WRITE, b"text")
    assert client.ask(Opcode.READ, size=1).error == FtpError.INVALID_SESSION
    assert client.ask(Opcode.BURST, size=1).error == FtpError.INVALID_SESSION


@pytest.mark.parametrize(
    ("opcode", "data", "offset", "error"),
    [
        (Opcode.OPEN_TO_READ, b"nope", 0, FtpError.NOT_FOUND),
        (Opcode.OPEN_TO_READ, b"../text", 0, FtpError.NOT_FOUND),
        (Opcode.OPEN_TO_READ, b"\xff\xfe", 0, FtpError.NOT_FOUND),
        (Opcode.OPEN_TO_READ, b"logs", 0, FtpError.FAIL_ERRNO),
        (Opcode.LIST, b"nope", 0, FtpError.NOT_FOUND),
        (Opcode.LIST, b"text", 0, FtpError.FAIL_ERRNO),
        (Opcode.LIST, b"", 99, FtpError.END_OF_FILE),
        (Opcode.LIST, b"logs", 0, FtpError.END_OF_FILE),
        (Opcode.CREATE, b"@PARAM/param.pck", 0, FtpError.PROTECTED),
        (Opcode.OPEN_TO_WRITE, b"@PARAM/param.pck", 0, FtpError.PROTECTED),
        (Opcode.CREATE, b"nope/new", 0, FtpError.NOT_FOUND),
        (Opcode.CREATE, b"tab\tname", 0, FtpError.FAIL_ERRNO),
        (Opcode.REMOVE, b"nope", 0, FtpError.NOT_FOUND),
        (Opcode.MAKE_FOLDER, b"text", 0, FtpError.EXISTS),
        (Opcode.MAKE_FOLDER, b"/", 0, FtpError.EXISTS),
        (Opcode.REMOVE_FOLDER, b"text", 0, FtpError.FAIL_ERRNO),
        (Opcode.RENAME, b"nope\0new", 0, FtpError.NOT_FOUND),
        (Opcode.RENAME, b"text\0logs", 0, FtpError.EXISTS),
        (Opcode.RENAME, b"text", 0, FtpError.INVALID_DATA_SIZE),
        (Opcode.RENAME, b"text\0", 0, FtpError.INVALID_DATA_SIZE),
        (Opcode.RENAME, b"text\0..", 0, FtpError.NOT_FOUND),
        (Opcode.TRUNCATE, b"text", len(TEXT) + 1, FtpError.END_OF_FILE),
        (Opcode.TRUNCATE, b"nope", 0, FtpError.NOT_FOUND),
        (Opcode.CHECKSUM, b"nope", 0, FtpError.NOT_FOUND),
        (17, b"text", 0, FtpError.UNKNOWN_COMMAND),
        (200, b"", 0, FtpError.UNKNOWN_COMMAND),
    ],
)
def test_refusals(client: Client, opcode: int, data: bytes, offset: int, error: int) -> None:
    client.session = 77
    refused = client.ask(opcode, data, offset)  # which checks that the session is echoed: else MAVProxy waits on
    assert refused.error == error
    assert client.listed(b"/") == [b"D@PARAM", b"Dlogs", b"Ftext\t%d" % len(TEXT)]


def test_changes(client: Client) -> None:
    client.do(Opcode.OPEN_TO_WRITE, b"made")
    assert b"Fmade\t0" in client.listed(b"/")
    client.do(Opcode.TERMINATE)
    client.do(Opcode.REMOVE, b"made")
    client.do(Opcode.MAKE_FOLDER, b"d")
    client.do(Opcode.RENAME, b"text\0d/renamed\0")
    assert client.ask(Opcode.REMOVE_FOLDER, b"d").data == bytes((FtpError.FAIL_ERRNO, 39))  # ENOTEMPTY
    client.do(Opcode.TRUNCATE, b"d/renamed", offset=3)
    assert client.listed(b"d") == [b"Frenamed\t3"]
    client.do(Opcode.REMOVE, b"d/renamed")
    client.do(Opcode.REMOVE_FOLDER, b"d")
    assert client.listed(b"/") == [b"D@PARAM", b"Dlogs"]


@pytest.mark.parametrize("opcode", [Opcode.CREATE, Opcode.WRITE, Opcode.LIST, Opcode.READ, Opcode.NONE])
def test_a_size_that_no_payload_has_is_refused(client: Client, opcode: int) -> None:
    assert client.ask(opcode, b"x" * DATA_BYTES, size=240).error == FtpError.INVALID_DATA_SIZE


def test_an_answer_is_not_answered(client: Client) -> None:
    assert client.send(Opcode.ACK) == client.send(Opcode.NAK, bytes([FtpError.UNKNOWN_COMMAND])) == []


def test_a_long_folder_is_listed_in_parts(client: Client, memory: MemoryFiles) -> None:
    memory.make_folder(("many",))
    names = [f"{number:03}" + "x" * (number % 200) for number in range(300)]
    for name in names:
        memory.create(("many", name))
    assert client.listed(b"many") == [b"F%s\t0" % name.encode() for name in names]


def test_entries_have_times_where_they_are_asked_for(client: Client) -> None:
    expected = [b"D@PARAM\t0\t0", b"Dlogs\t0\t0", b"Ftext\t%d\t0" % len(TEXT)]
    assert client.listed(b"/", Opcode.LIST_WITH_TIME) == expected


def test_a_name_that_cannot_be_told_is_skipped(client: Client, memory: MemoryFiles) -> None:
    longest = DATA_BYTES - len(b"F\t0\0")
    memory.create(("x" * longest,))
    assert client.listed(b"/")[-1] == b"F%s\t0" % (b"x" * longest)
    memory.create(("y" * (longest + 1),))
    assert client.listed(b"/")[-1] == b"S"
    memory.create(("z",))
    assert client.listed(b"/")[-2:] == [b"S", b"Fz\t0"]


@pytest.mark.parametrize("length", [0, 1, 1000, ftp.CHECKSUM_BYTES_A_POLL, 3 * ftp.CHECKSUM_BYTES_A_POLL + 1])
def test_checksum(client: Client, memory: MemoryFiles, length: int) -> None:
    """https://mavlink.io/en/guide/crc.html: from 0, not inverted; a large file takes some polls."""
    data = random.Random(length).randbytes(length)
    memory.create(("data",))
    memory.write(("data",), 0, data)
    client.sequence += 1
    replies = client.send(Opcode.CHECKSUM, b"data")
    polls = 0
    while not replies:
        polls += 1
        if polls == 2:  # asked again, with another number, after a timeout
            client.sequence += 1
            assert client.send(Opcode.CHECKSUM, b"data") == []
        replies = client.poll()
    assert polls == max(length - 1, 0) // ftp.CHECKSUM_BYTES_A_POLL
    (reply,) = replies
    assert reply.sequence == client.sequence + 1
    assert int.from_bytes(reply.data, "little") == crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF
    assert client.poll() == []


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
    client: Client, memory: MemoryFiles, opcode: int, data: bytes
) -> None:
    memory.make_folder(("empty",))
    first = client.ask(opcode, data)
    assert client.send(opcode, data) == [first]
    assert first.opcode == Opcode.ACK
    assert client.ask(opcode, data).opcode == Opcode.NAK  # with another number it is another request
    client.now_us += ftp.REMEMBERED_FOR_US + 1
    client.sequence -= 1
    assert client.send(opcode, data)[0].opcode == Opcode.NAK


def test_a_file_is_not_emptied_by_a_repeated_request(client: Client, memory: MemoryFiles) -> None:
    client.do(Opcode.CREATE, b"new")
    created = client.sequence
    client.do(Opcode.WRITE, b"hello")
    client.sequence = created
    assert client.send(Opcode.CREATE, b"new")[0].opcode == Opcode.ACK
    assert memory.open(("new",)).size == 5


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
    memory = MemoryFiles()
    memory.create(("text",))
    service = Ftp(Tree(memory, {"logs": MemoryFiles()}, {"@PARAM/param.pck": lambda query: query.encode()}))
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
                assert reply.error in set(FtpError)
