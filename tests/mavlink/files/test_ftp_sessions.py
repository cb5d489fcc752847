"""FTP sessions: owners, limits and ends."""

from colibri.mavlink.files import ftp
from colibri.mavlink.files.ftp import Ftp
from colibri.mavlink.files.ftp_wire import FtpError, Opcode
from colibri.mavlink.files.memory import MemoryFiles
from colibri.mavlink.node.service import Peer
from tests.support.ftp_client import OTHER, PEER, TEXT, Client


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


def test_every_client_has_its_own_sessions(service: Ftp, memory: MemoryFiles) -> None:
    memory.create(("other",))
    memory.write(("other",), 0, b"other")
    one, two = Client(service), Client(service, OTHER)
    one.do(Opcode.OPEN_TO_READ, b"text")
    two.do(Opcode.OPEN_TO_READ, b"other")
    assert one.do(Opcode.READ, size=5) == TEXT[:5]
    assert two.do(Opcode.READ, size=5) == b"other"
    two.do(Opcode.RESET)
    assert one.do(Opcode.READ, size=5) == TEXT[:5]
    assert two.ask(Opcode.READ, size=5).error == FtpError.INVALID_SESSION


def test_the_end_of_a_session_forgets_its_own_answers_alone(service: Ftp) -> None:
    one, two = Client(service), Client(service, OTHER)
    kept = two.ask(Opcode.MAKE_FOLDER, b"a")
    one.do(Opcode.OPEN_TO_READ, b"text")
    one.do(Opcode.TERMINATE)
    assert two.send(Opcode.MAKE_FOLDER, b"a") == [kept]


def test_a_client_may_have_several_sessions_but_not_too_many(service: Ftp) -> None:
    for session in range(ftp.MAX_SESSIONS_OF_A_CHANNEL):
        Client(service, PEER, session).do(Opcode.OPEN_TO_READ, b"text")
    full = Client(service, PEER, 200)
    assert full.ask(Opcode.OPEN_TO_READ, b"text").error == FtpError.NO_SESSIONS
    assert full.ask(Opcode.CREATE, b"never").error == FtpError.NO_SESSIONS
    assert b"Fnever\t0" not in full.listed(b"/")
    Client(service, OTHER).do(Opcode.OPEN_TO_READ, b"text")
    Client(service, PEER, 3).do(Opcode.TERMINATE)
    full.do(Opcode.OPEN_TO_READ, b"text")


def test_one_channel_cannot_take_all_sessions(service: Ftp) -> None:
    """Neither under many ids, nor from many ports: the owner opens a file, and keeps its first one."""
    owner = Client(service, Peer(99, 255, 190))
    owner.do(Opcode.OPEN_TO_READ, b"text")
    opened = [
        Client(service, Peer(channel, system, 190), session).ask(Opcode.OPEN_TO_READ, b"text").opcode
        for channel in range(6)
        for system in range(2, 7)
        for session in range(8)
    ]
    assert opened[:40] == [Opcode.ACK] * ftp.MAX_SESSIONS_OF_A_CHANNEL + [Opcode.NAK] * 32
    assert len(service._sessions) == ftp.MAX_SESSIONS  # noqa: SLF001
    Client(service, Peer(99, 255, 190), 7).do(Opcode.OPEN_TO_READ, b"text")
    assert owner.do(Opcode.READ, size=3) == TEXT[:3]


def test_an_idle_session_ends(client: Client) -> None:
    client.do(Opcode.OPEN_TO_READ, b"text")
    client.now_us += ftp.SESSION_ENDS_AFTER_US
    client.do(Opcode.READ, size=1)
    client.now_us += ftp.SESSION_ENDS_AFTER_US + 1
    assert client.ask(Opcode.READ, size=1).error == FtpError.INVALID_SESSION


def test_only_an_idle_session_is_taken_over(client: Client) -> None:
    client.do(Opcode.OPEN_TO_READ, b"text")
    client.do(Opcode.OPEN_TO_READ, b"text")  # the answer was lost, and MAVSDK asks with another number
    assert client.ask(Opcode.OPEN_TO_READ, b"@PARAM/param.pck").error == FtpError.NO_SESSIONS
    assert client.ask(Opcode.CREATE, b"new").error == FtpError.NO_SESSIONS
    assert b"Fnew\t0" not in client.listed(b"/")
    assert client.do(Opcode.READ, size=3) == TEXT[:3]
    client.now_us += ftp.TAKEN_OVER_AFTER_US
    client.do(Opcode.CREATE, b"new")
    client.do(Opcode.WRITE, b"x")


def test_a_session_is_ended_as_often_as_it_is_asked_for(client: Client) -> None:
    """MAVSDK fails a download that is complete if the end, asked for again after a lost answer, is refused."""
    client.do(Opcode.OPEN_TO_READ, b"text")
    assert client.do(Opcode.TERMINATE) == client.do(Opcode.TERMINATE) == b""
