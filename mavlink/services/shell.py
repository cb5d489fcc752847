"""A shell over SERIAL_CONTROL (126), device SHELL, with a few commands that only report."""

from collections.abc import Callable, Iterable, Mapping
from typing import TypeAlias

from colibri.mavlink.node.budget import Budget
from colibri.mavlink.node.service import IDLE, Peer, Send, first_to_go, to
from colibri.mavlink.wire.dialect import Message, mav

DATA_BYTES = 70
MAX_LINE_BYTES = 200
MAX_ANSWER_BYTES = 20_000
MESSAGES_A_POLL = 10
MAX_PEERS = 16
_ANSWER_US, _LETTER_US = 20.0, 0.05  # work for an answer, and for each of its letters
PROMPT = "colibri> "

_SHELL: int = mav.SERIAL_CONTROL_DEV_SHELL
_REPLY: int = mav.SERIAL_CONTROL_FLAG_REPLY
_RESPOND: int = mav.SERIAL_CONTROL_FLAG_RESPOND

Command: TypeAlias = Callable[[list[str]], str]  # (arguments) -> lines of text


class Shell:
    """Runs the shell's commands."""

    handles = frozenset({"SERIAL_CONTROL"})

    def __init__(self, commands: Mapping[str, Command], budget: Budget | None = None) -> None:
        self._budget = budget or Budget()
        self._commands = {"help": self._help, **commands}
        self._lines: dict[Peer, bytes] = {}
        self._answers: dict[Peer, bytes] = {}

    def receive(self, message: Message, peer: Peer, _now_us: int) -> Iterable[Send]:
        fields = message.fields
        if fields.device != _SHELL or fields.flags & _REPLY:
            return ()
        if peer not in self._lines and len(self._lines) >= MAX_PEERS:
            forgotten = first_to_go(self._lines)
            del self._lines[forgotten]
            self._answers.pop(forgotten, None)
        typed = bytes(fields.data)[: fields.count]
        *lines, begun = (self._lines.pop(peer, b"") + typed.replace(b"\r", b"\n")).split(b"\n")
        self._lines[peer] = begun[:MAX_LINE_BYTES]
        for line in lines if fields.flags & _RESPOND else ():
            text = self._answer(line) + PROMPT
            self._budget.spend(_ANSWER_US + _LETTER_US * len(text))
            self._answers[peer] = (self._answers.get(peer, b"") + text.encode(errors="replace"))[:MAX_ANSWER_BYTES]
        return ()

    def poll(self, _now_us: int) -> Iterable[Send]:
        if not self._answers:
            return IDLE
        sends: list[Send] = []
        for peer, text in list(self._answers.items()):
            for start in range(0, min(len(text), MESSAGES_A_POLL * DATA_BYTES), DATA_BYTES):
                part = text[start : start + DATA_BYTES]
                data = part.ljust(DATA_BYTES, b"\0")
                sends.append(to(peer, "SERIAL_CONTROL", _SHELL, _REPLY, 0, 0, len(part), data))
            self._answers[peer] = text[MESSAGES_A_POLL * DATA_BYTES :]
            if not self._answers[peer]:
                del self._answers[peer]
        return sends

    def _answer(self, line: bytes) -> str:
        typed = "".join(letter for letter in line.decode(errors="replace") if letter.isprintable())
        name, *arguments = typed.split() or [""]
        if not name:
            return "\n"
        echo = " ".join((name, *arguments)) + "\n"
        command = self._commands.get(name)
        text = command(arguments) if command is not None else f"{name}: not a command, try help"
        return echo + text.rstrip("\n") + "\n"

    def _help(self, _: list[str]) -> str:
        return " ".join(sorted(self._commands))
