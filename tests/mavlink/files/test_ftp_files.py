"""File transfer: files and folders are read, written, listed and changed, in the order in which clients ask."""

import random
from zlib import crc32

import pytest

from colibri.mavlink.files import ftp
from colibri.mavlink.files.ftp import Ftp
from colibri.mavlink.files.ftp_wire import DATA_BYTES, Error, Opcode
from colibri.mavlink.files.memory import Memory
from colibri.mavlink.node.service import Peer
from tests.support.ftp_client import TEXT, Client


def test_a_file_is_read(client: Client) -> None:
    assert int.from_bytes(client.do(Opcode.OPEN_TO_READ, b"/text"), "little") == len(TEXT)
    assert client.do(Opcode.READ, offset=10, size=20) == TEXT[10:30]
    assert client.do(Opcode.READ, offset=len(TEXT) - 5, size=DATA_BYTES) == TEXT[-5:]
    assert client.do(Opcode.READ, offset=3, size=0) == TEXT[3 : 3 + DATA_BYTES]
    past = client.ask(Opcode.READ, offset=len(TEXT), size=1)
    assert (past.error, past.offset) == (Error.END_OF_FILE, len(TEXT))
    assert client.do(Opcode.TERMINATE) == b""
    assert client.ask(Opcode.READ, size=1).error == Error.INVALID_SESSION


@pytest.mark.parametrize("path", [b"text", b"/text", b"//./text", b"/text\0", b"/text\0garbage"])
def test_a_path_may_be_said_in_several_ways(client: Client, path: bytes) -> None:
    assert client.ask(Opcode.OPEN_TO_READ, path).opcode == Opcode.ACK


def test_a_path_may_have_a_query(client: Client) -> None:
    client.do(Opcode.OPEN_TO_READ, b"@PARAM/param.pck?withdefaults=1")
    assert client.do(Opcode.READ, size=100) == b"Qwithdefaults=1"


@pytest.mark.parametrize("size", [DATA_BYTES, 80, 1])
@pytest.mark.parametrize("length", [0, 1, 80, 160, DATA_BYTES, 2 * DATA_BYTES, 1000])
def test_a_burst_brings_the_rest_of_a_file(client: Client, memory: Memory, size: int, length: int) -> None:
    memory.truncate(("text",), length)
    client.do(Opcode.OPEN_TO_READ, b"text")
    replies = client.burst(0, size)
    if length == 0:
        assert [reply.error for reply in replies] == [Error.END_OF_FILE]
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


def test_a_client_that_is_gone_is_not_sent_a_large_file(client: Client, memory: Memory) -> None:
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


def test_a_file_that_is_cut_while_it_is_read_ends(client: Client, memory: Memory) -> None:
    client.do(Opcode.OPEN_TO_READ, b"text")
    client.send(Opcode.BURST, size=100)
    client.poll()
    memory.truncate(("text",), 850)
    (last,) = client.poll()
    assert (last.offset, last.size, last.burst_complete) == (800, 50, 1)
    client.send(Opcode.BURST, size=100)
    memory.remove(("text",))
    (gone,) = client.poll()
    assert gone.error == Error.NOT_FOUND
    assert client.poll() == []


def test_a_file_is_written(client: Client, memory: Memory) -> None:
    assert client.do(Opcode.CREATE, b"new") == b""
    second = client.ask(Opcode.WRITE, b"world", offset=6)
    assert (second.opcode, second.offset, second.size) == (Opcode.ACK, 6, 0)  # MAVProxy tells the parts by the offset
    client.do(Opcode.WRITE, b"hello ", offset=0)
    client.do(Opcode.TERMINATE)
    assert client.ask(Opcode.WRITE, b"x").error == Error.INVALID_SESSION
    client.do(Opcode.OPEN_TO_WRITE, b"new")
    client.do(Opcode.WRITE, b"H", offset=0)
    assert memory.open(("new",)).read(0, 100) == b"Hello world"  # type: ignore[union-attr]
    client.do(Opcode.CREATE, b"new")
    assert memory.open(("new",)).size == 0  # type: ignore[union-attr]


def test_what_is_open_to_read_is_not_written_and_the_reverse(client: Client) -> None:
    client.do(Opcode.OPEN_TO_READ, b"text")
    assert client.ask(Opcode.WRITE, b"x").error == Error.PROTECTED
    client.do(Opcode.TERMINATE)
    client.do(Opcode.OPEN_TO_WRITE, b"text")
    assert client.ask(Opcode.READ, size=1).error == Error.INVALID_SESSION
    assert client.ask(Opcode.BURST, size=1).error == Error.INVALID_SESSION


@pytest.mark.parametrize(
    ("opcode", "data", "offset", "error"),
    [
        (Opcode.OPEN_TO_READ, b"nope", 0, Error.NOT_FOUND),
        (Opcode.OPEN_TO_READ, b"../text", 0, Error.NOT_FOUND),
        (Opcode.OPEN_TO_READ, b"\xff\xfe", 0, Error.NOT_FOUND),
        (Opcode.OPEN_TO_READ, b"logs", 0, Error.FAIL_ERRNO),
        (Opcode.LIST, b"nope", 0, Error.NOT_FOUND),
        (Opcode.LIST, b"text", 0, Error.FAIL_ERRNO),
        (Opcode.LIST, b"", 99, Error.END_OF_FILE),
        (Opcode.LIST, b"logs", 0, Error.END_OF_FILE),
        (Opcode.CREATE, b"@PARAM/param.pck", 0, Error.PROTECTED),
        (Opcode.OPEN_TO_WRITE, b"@PARAM/param.pck", 0, Error.PROTECTED),
        (Opcode.CREATE, b"nope/new", 0, Error.NOT_FOUND),
        (Opcode.CREATE, b"tab\tname", 0, Error.FAIL_ERRNO),
        (Opcode.REMOVE, b"nope", 0, Error.NOT_FOUND),
        (Opcode.MAKE_FOLDER, b"text", 0, Error.EXISTS),
        (Opcode.MAKE_FOLDER, b"/", 0, Error.EXISTS),
        (Opcode.REMOVE_FOLDER, b"text", 0, Error.FAIL_ERRNO),
        (Opcode.RENAME, b"nope\0new", 0, Error.NOT_FOUND),
        (Opcode.RENAME, b"text\0logs", 0, Error.EXISTS),
        (Opcode.RENAME, b"text", 0, Error.INVALID_DATA_SIZE),
        (Opcode.RENAME, b"text\0", 0, Error.INVALID_DATA_SIZE),
        (Opcode.RENAME, b"text\0..", 0, Error.NOT_FOUND),
        (Opcode.TRUNCATE, b"text", len(TEXT) + 1, Error.END_OF_FILE),
        (Opcode.TRUNCATE, b"nope", 0, Error.NOT_FOUND),
        (Opcode.CHECKSUM, b"nope", 0, Error.NOT_FOUND),
        (17, b"text", 0, Error.UNKNOWN_COMMAND),
        (200, b"", 0, Error.UNKNOWN_COMMAND),
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
    assert client.ask(Opcode.REMOVE_FOLDER, b"d").data == bytes((Error.FAIL_ERRNO, 39))  # ENOTEMPTY
    client.do(Opcode.TRUNCATE, b"d/renamed", offset=3)
    assert client.listed(b"d") == [b"Frenamed\t3"]
    client.do(Opcode.REMOVE, b"d/renamed")
    client.do(Opcode.REMOVE_FOLDER, b"d")
    assert client.listed(b"/") == [b"D@PARAM", b"Dlogs"]


@pytest.mark.parametrize("opcode", [Opcode.CREATE, Opcode.WRITE, Opcode.LIST, Opcode.READ, Opcode.NONE])
def test_a_size_that_no_payload_has_is_refused(client: Client, opcode: int) -> None:
    assert client.ask(opcode, b"x" * DATA_BYTES, size=240).error == Error.INVALID_DATA_SIZE


def test_an_answer_is_not_answered(client: Client) -> None:
    assert client.send(Opcode.ACK) == client.send(Opcode.NAK, bytes([Error.UNKNOWN_COMMAND])) == []


def test_a_long_folder_is_listed_in_parts(client: Client, memory: Memory) -> None:
    memory.make_folder(("many",))
    names = [f"{number:03}" + "x" * (number % 200) for number in range(300)]
    for name in names:
        memory.create(("many", name))
    assert client.listed(b"many") == [b"F%s\t0" % name.encode() for name in names]


def test_entries_have_times_where_they_are_asked_for(client: Client) -> None:
    expected = [b"D@PARAM\t0\t0", b"Dlogs\t0\t0", b"Ftext\t%d\t0" % len(TEXT)]
    assert client.listed(b"/", Opcode.LIST_WITH_TIME) == expected


def test_a_name_that_cannot_be_told_is_skipped(client: Client, memory: Memory) -> None:
    longest = DATA_BYTES - len(b"F\t0\0")
    memory.create(("x" * longest,))
    assert client.listed(b"/")[-1] == b"F%s\t0" % (b"x" * longest)
    memory.create(("y" * (longest + 1),))
    assert client.listed(b"/")[-1] == b"S"
    memory.create(("z",))
    assert client.listed(b"/")[-2:] == [b"S", b"Fz\t0"]


@pytest.mark.parametrize("length", [0, 1, 1000, ftp.CHECKSUM_BYTES_A_POLL, 3 * ftp.CHECKSUM_BYTES_A_POLL + 1])
def test_checksum(client: Client, memory: Memory, length: int) -> None:
    """https://mavlink.io/en/guide/crc.html: from 0, not inverted; a large file takes some polls."""
    data = random.Random(length).randbytes(length)
    memory.create(("data",))
    memory.write(("data",), 0, data)
    client.sequence += 1
    replies = client.send(Opcode.CHECKSUM, b"data")
    polls = 0
    while not replies:
        polls += 1
        if polls == 2:  # asked again, with another number, by a client that lost patience
            client.sequence += 1
            assert client.send(Opcode.CHECKSUM, b"data") == []
        replies = client.poll()
    assert polls == max(length - 1, 0) // ftp.CHECKSUM_BYTES_A_POLL
    (reply,) = replies
    assert reply.sequence == client.sequence + 1
    assert int.from_bytes(reply.data, "little") == crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF
    assert client.poll() == []
