"""The shell: lines in, text out."""

from hypothesis import given
from hypothesis import strategies as st

from colibri.mavlink.node.service import Peer
from colibri.mavlink.services import shell
from colibri.mavlink.services.shell import PROMPT, Shell
from colibri.mavlink.wire.dialect import mav
from tests.support.messages import GROUND, OTHER, message, on_the_wire

RESPOND = mav.SERIAL_CONTROL_FLAG_RESPOND
REPLY = mav.SERIAL_CONTROL_FLAG_REPLY
DEVICE = mav.SERIAL_CONTROL_DEV_SHELL


def new() -> Shell:
    return Shell({"echo": " ".join, "long": lambda _: "x" * 5000, "flood": lambda _: "y" * 100_000})


def type_in(
    service: Shell,
    text: bytes,
    peer: Peer = GROUND,
    device: int = DEVICE,
    flags: int = RESPOND,
    count: int | None = None,
) -> None:
    count = len(text) if count is None else count
    typed = message("SERIAL_CONTROL", device, flags, 0, 0, count, text.ljust(70, b"\0"), peer=peer)
    assert list(service.receive(typed, peer, 0)) == []


def printed(service: Shell, peer: Peer = GROUND) -> str:
    text = b""
    while True:
        sends = list(service.poll(0))
        if not sends:
            return text.decode()
        assert all(send.channel == peer.channel for send in sends)
        for sent in on_the_wire(sends):
            assert (sent.fields.device, sent.fields.flags) == (DEVICE, REPLY)
            text += bytes(sent.fields.data[: sent.fields.count])


def test_a_line_is_answered() -> None:
    service = new()
    for typed, answer in (
        (b"echo a  b\n", "echo a b\na b\n"),
        (b"help\r", "help\necho flood help long\n"),
        (b"rm -rf /\n", "rm -rf /\nrm: not a command, try help\n"),
        (b"\n", "\n"),
    ):
        type_in(service, typed)
        assert printed(service) == f"{answer}{PROMPT}"


def test_a_line_may_come_in_parts_and_several_at_once() -> None:
    service = new()
    type_in(service, b"echo ", flags=0)
    type_in(service, b"one\necho two\nec")
    assert printed(service) == f"echo one\none\n{PROMPT}echo two\ntwo\n{PROMPT}"
    type_in(service, b"ho 3\n")
    assert printed(service) == f"echo 3\n3\n{PROMPT}"


def test_a_long_answer_is_paced_and_whole() -> None:
    service = new()
    type_in(service, b"long\n")
    assert len(list(service.poll(0))) == shell.MESSAGES_A_POLL
    assert len(printed(service)) == len(f"long\n{'x' * 5000}\n{PROMPT}") - shell.MESSAGES_A_POLL * shell.DATA_BYTES


def test_clients_do_not_see_each_other() -> None:
    service = new()
    type_in(service, b"echo m")
    type_in(service, b"echo other\n", peer=OTHER)
    assert "other" in printed(service, OTHER)
    type_in(service, b"e\n")
    assert printed(service) == f"echo me\nme\n{PROMPT}"


def test_what_is_not_for_the_shell_is_left_alone() -> None:
    service = new()
    type_in(service, b"help\n", device=0)
    type_in(service, b"help\n", flags=RESPOND | REPLY)
    type_in(service, b"help\n", flags=0)  # nobody wants an answer
    assert printed(service) == ""


def test_memory_is_bounded() -> None:
    service = new()
    for number in range(100):
        type_in(service, b"x" * 70, peer=Peer(number, 1, 1))
        for _ in range(5):
            type_in(service, b"\nflood\n" + b"x" * 63, peer=Peer(number, 1, 1))
    assert len(service._lines) <= shell.MAX_PEERS  # noqa: SLF001
    assert len(service._answers) <= shell.MAX_PEERS  # noqa: SLF001
    assert all(len(text) <= shell.MAX_ANSWER_BYTES for text in service._answers.values())  # noqa: SLF001


@given(st.lists(st.tuples(st.binary(max_size=70), st.integers(0, 255), st.integers(0, 31)), max_size=10))
def test_typed_text_never_raises_or_returns_control_bytes(typed: list[tuple[bytes, int, int]]) -> None:
    service = new()
    for text, count, flags in typed:
        type_in(service, text, count=count, flags=flags)
    assert all(letter.isprintable() or letter == "\n" for letter in printed(service))
