"""The command microservice: mavlink.io/en/services/command.html."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import nan
from typing import Any, NamedTuple, TypeAlias

from colibri.mavlink.node.service import IDLE, Peer, Send, to
from colibri.mavlink.services.statustext import ERROR, INFO, WARNING, StatusText
from colibri.mavlink.wire.dialect import Message, Refusal, bits, mav

ACCEPTED: int = mav.MAV_RESULT_ACCEPTED
TEMPORARILY_REJECTED: int = mav.MAV_RESULT_TEMPORARILY_REJECTED
DENIED: int = mav.MAV_RESULT_DENIED
UNSUPPORTED: int = mav.MAV_RESULT_UNSUPPORTED
FAILED: int = mav.MAV_RESULT_FAILED
IN_PROGRESS: int = mav.MAV_RESULT_IN_PROGRESS
UNSUPPORTED_MAV_FRAME = 9  # MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME; missing in pymavlink's dialects

_SEVERITIES = {FAILED: ERROR, UNSUPPORTED: INFO}  # others are warnings; ground stations ask for unsupported commands

PENDING = Refusal(result=-1)  # the command takes a few frames: `finish` sends the answer

PROGRESS_UNKNOWN = 0xFF  # COMMAND_ACK.progress of a pending command
NOT_GIVEN = 2**31 - 1  # the integer x and y of a COMMAND_INT for nan in a COMMAND_LONG
DEGREES = 1e-7

_GLOBAL = ("GLOBAL", "GLOBAL_RELATIVE_ALT", "GLOBAL_TERRAIN_ALT")
GLOBAL_FRAMES = frozenset(bits("MAV_FRAME_", name + suffix) for name in _GLOBAL for suffix in ("", "_INT"))
"""Frames with latitude and longitude. MISSION_ITEM_INT has them in degE7 whether or not the frame's name ends
in INT, as all clients send them.
"""
PLACES: frozenset[int] = GLOBAL_FRAMES | {mav.MAV_FRAME_MISSION}  # the last means without one

PROGRESS_EVERY_US = 1_000_000
REMEMBERED_FOR_US = 10_000_000
MAX_REMEMBERED = 64
SAME_REASON_AFTER_US = 1_000_000


class ReceivedCommand(NamedTuple):
    """A command, COMMAND_LONG and COMMAND_INT alike; nan in a parameter means not given."""

    id: int  # MAV_CMD
    p1: float
    p2: float
    p3: float
    p4: float
    x: float  # parameter five, degrees if a latitude
    y: float  # parameter six, degrees if a longitude
    z: float  # parameter seven
    frame: int | None  # MAV_FRAME; `None` of a COMMAND_LONG
    peer: Peer
    now_us: int


Handler: TypeAlias = Callable[[ReceivedCommand], Refusal | None]
"""Executes one kind of command or refuses it. Must check every parameter that it uses."""


@dataclass(slots=True)
class _Running:
    command: ReceivedCommand
    report_at_us: int


class _Answered(NamedTuple):
    parameters: tuple[str, ...]
    confirmation: int
    at_us: int
    refusal: Refusal | None


def command_name(number: int) -> str:
    """Return the name of a MAV_CMD without its prefix, and its number."""
    definition = mav.enums["MAV_CMD"].get(number)
    return f"{definition.name.removeprefix('MAV_CMD_')} ({number})" if definition else f"command {number}"


class CommandService:
    """Dispatches and acknowledges commands; denies all while the vehicle is `closed`."""

    handles = frozenset({"COMMAND_LONG", "COMMAND_INT", "COMMAND_CANCEL"})

    def __init__(self, handlers: Mapping[int, Handler], text: StatusText) -> None:
        self._handlers = handlers
        self._text = text
        self.closed = ""
        self._running: dict[int, _Running] = {}
        self._answered: dict[tuple[Peer, int], _Answered] = {}
        self._said: tuple[str, int] = ("", -SAME_REASON_AFTER_US)

    def receive(self, message: Message, peer: Peer, now_us: int) -> Iterable[Send]:
        fields = message.fields
        if message.name == "COMMAND_CANCEL":
            # Nothing can be cancelled: what is in progress goes on. "If it has already completed [it] can be ignored".
            return [_ack(fields.command, peer, IN_PROGRESS)] if fields.command in self._running else []
        if self.closed:
            return [_ack(fields.command, peer, DENIED), *self._reason(Refusal(self.closed), now_us)]
        handler = self._handlers.get(fields.command)
        if handler is None:
            return self._refused(fields.command, peer, UNSUPPORTED, "is not supported", now_us)
        if message.name == "COMMAND_LONG":
            return self._obey(handler, _from_long(fields, peer, now_us), fields.confirmation)
        definition = mav.enums["MAV_CMD"].get(fields.command)
        goes_to_a_place = definition is not None and definition.has_location  # only then its frame counts
        if goes_to_a_place and fields.frame not in PLACES:
            return self._refused(fields.command, peer, UNSUPPORTED_MAV_FRAME, f"in frame {fields.frame}", now_us)
        return self._obey(handler, _from_int(fields, goes_to_a_place, peer, now_us), 0)

    def poll(self, now_us: int) -> Iterable[Send]:
        if not self._running:
            return IDLE
        sends = []
        for number, running in self._running.items():
            if not 0 < running.report_at_us - now_us <= PROGRESS_EVERY_US:
                running.report_at_us = now_us + PROGRESS_EVERY_US
                sends.append(_ack(number, running.command.peer, IN_PROGRESS))
        return sends

    def finish(self, command_id: int, peer: Peer, refusal: Refusal | None) -> list[Send]:
        running = self._running.get(command_id)
        if running is None or running.command.peer != peer:
            return []
        del self._running[command_id]
        now_us = running.command.now_us
        return [self._answered_with(running.command, 0, refusal, now_us), *self._reason(refusal, now_us)]

    def _refused(self, number: int, peer: Peer, result: int, why: str, now_us: int) -> list[Send]:
        return [_ack(number, peer, result), *self._reason(Refusal(f"{command_name(number)} {why}", result), now_us)]

    def _obey(self, handler: Handler, command: ReceivedCommand, confirmation: int) -> list[Send]:
        """Execute a command unless it is repeated after a lost answer, or another is in progress."""
        running = self._running.get(command.id)
        if running is not None:
            if running.command.peer == command.peer and _parameters(running.command) == _parameters(command):
                return [_ack(command.id, command.peer, IN_PROGRESS)]
            return self._refused(command.id, command.peer, TEMPORARILY_REJECTED, "is in progress", command.now_us)
        before = self._answered.get((command.peer, command.id))
        if before is not None and _is_sent_again(command, confirmation, before):
            return [self._answered_with(command, confirmation, before.refusal, before.at_us)]
        refusal = handler(command)
        if refusal is PENDING:
            self._running[command.id] = _Running(command, command.now_us + PROGRESS_EVERY_US)
            return []
        ack = self._answered_with(command, confirmation, refusal, command.now_us)
        return [ack, *self._reason(refusal, command.now_us)]

    def _answered_with(self, command: ReceivedCommand, confirmation: int, refusal: Refusal | None, at_us: int) -> Send:
        key = (command.peer, command.id)
        self._answered.pop(key, None)
        if len(self._answered) >= MAX_REMEMBERED:
            del self._answered[next(iter(self._answered))]
        self._answered[key] = _Answered(_parameters(command), confirmation, at_us, refusal)
        return _ack(command.id, command.peer, ACCEPTED if refusal is None else refusal.result)

    def _reason(self, refusal: Refusal | None, now_us: int) -> list[Send]:
        if refusal is None or not refusal.reason:
            return []
        reason, at_us = self._said
        if reason == refusal.reason and 0 <= now_us - at_us < SAME_REASON_AFTER_US:
            return []
        self._said = (refusal.reason, now_us)
        return self._text.say(_SEVERITIES.get(refusal.result, WARNING), refusal.reason)


def _from_long(fields: Any, peer: Peer, now_us: int) -> ReceivedCommand:
    numbers = (fields.param1, fields.param2, fields.param3, fields.param4, fields.param5, fields.param6, fields.param7)
    return ReceivedCommand(fields.command, *numbers, None, peer, now_us)


def _from_int(fields: Any, goes_to_a_place: bool, peer: Peer, now_us: int) -> ReceivedCommand:
    """Convert x and y of a place to degrees: "PARAM5 / global: latitude * 10^7"."""
    scale = 1.0
    if goes_to_a_place:
        scale = DEGREES if fields.frame in GLOBAL_FRAMES else nan
    x, y = (nan if number == NOT_GIVEN else number * scale for number in (fields.x, fields.y))
    numbers = (fields.param1, fields.param2, fields.param3, fields.param4, x, y, fields.z)
    return ReceivedCommand(fields.command, *numbers, fields.frame, peer, now_us)


def _parameters(command: ReceivedCommand) -> tuple[str, ...]:
    return tuple(map(repr, command[1:9]))


def _is_sent_again(command: ReceivedCommand, confirmation: int, before: _Answered) -> bool:
    recent = 0 <= command.now_us - before.at_us < REMEMBERED_FOR_US
    return recent and confirmation > before.confirmation and before.parameters == _parameters(command)


def _ack(command_id: int, peer: Peer, result: int) -> Send:
    progress = PROGRESS_UNKNOWN if result == IN_PROGRESS else 0
    return to(peer, "COMMAND_ACK", command_id, result, progress, 0, peer.system, peer.component)
