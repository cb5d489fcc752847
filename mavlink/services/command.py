"""The command microservice: COMMAND_LONG and COMMAND_INT, answered by COMMAND_ACK.

Specification: mavlink.io/en/services/command.html.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import nan
from typing import Any, NamedTuple, TypeAlias

from colibri.mavlink.node.service import Peer, Send, to
from colibri.mavlink.services.statustext import ERROR, WARNING, StatusText
from colibri.mavlink.wire.dialect import Message, mav
from colibri.mavlink.wire.refusal import Refusal

ACCEPTED: int = mav.MAV_RESULT_ACCEPTED
TEMPORARILY_REJECTED: int = mav.MAV_RESULT_TEMPORARILY_REJECTED
DENIED: int = mav.MAV_RESULT_DENIED
UNSUPPORTED: int = mav.MAV_RESULT_UNSUPPORTED
FAILED: int = mav.MAV_RESULT_FAILED
IN_PROGRESS: int = mav.MAV_RESULT_IN_PROGRESS
CANCELLED = 6
COMMAND_INT_ONLY: int = mav.MAV_RESULT_COMMAND_INT_ONLY
UNSUPPORTED_MAV_FRAME = 9
"""MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME; pymavlink's dialects leave it out, and MAV_RESULT_CANCELLED."""

LATER = -1
"""The result of a command that is obeyed within a few frames: its sender receives nothing before `finish`."""

PROGRESS_UNKNOWN = 0xFF
NOT_GIVEN = 2**31 - 1
"""What x and y of a COMMAND_INT hold where a COMMAND_LONG would hold nan."""
DEGREES = 1e-7
METRES = 1e-4

GLOBAL_FRAMES: frozenset[int] = frozenset(
    (
        mav.MAV_FRAME_GLOBAL,
        mav.MAV_FRAME_GLOBAL_RELATIVE_ALT,
        mav.MAV_FRAME_GLOBAL_INT,
        mav.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
        mav.MAV_FRAME_GLOBAL_TERRAIN_ALT,
        mav.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
    )
)
"""Frames whose x and y are latitude and longitude. MISSION_ITEM_INT has them in degE7 whether or not the frame's name
ends in INT: so does everybody send them."""
PLACES: frozenset[int] = GLOBAL_FRAMES | {mav.MAV_FRAME_MISSION}
"""Frames of a command that goes to a place; MAV_FRAME_MISSION is no frame: the command then names no place."""

PROGRESS_EVERY_US = 1_000_000
REMEMBERED_FOR_US = 10_000_000
MAX_REMEMBERED = 64
SAME_REASON_AFTER_US = 1_000_000
_REFUSED = (TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED)


class Command(NamedTuple):
    """A command, COMMAND_LONG and COMMAND_INT alike.

    Attributes:
        id: MAV_CMD.
        p1, p2, p3, p4: Parameters one to four; nan in any of the seven means that it is not given.
        x, y, z: Five to seven; x and y in degrees where they are a place, nan where a COMMAND_INT has INT32_MAX.
        frame: MAV_FRAME of a COMMAND_INT; None of a COMMAND_LONG.
    """

    id: int
    p1: float
    p2: float
    p3: float
    p4: float
    x: float
    y: float
    z: float
    frame: int | None
    peer: Peer
    now_us: int


class Outcome(NamedTuple):
    """What became of a command.

    Attributes:
        result: MAV_RESULT.
        reason: Why it was refused, for the STATUSTEXT that goes with the COMMAND_ACK; empty for none.
        param2: COMMAND_ACK.result_param2.
        progress: Percent of a command in progress; 255 where nobody knows.
    """

    result: int = ACCEPTED
    reason: str = ""
    param2: int = 0
    progress: int = PROGRESS_UNKNOWN


def outcome_of(refusal: Refusal | None) -> Outcome:
    """Return what became of a command that was refused, or done at once."""
    return Outcome() if refusal is None else Outcome(refusal.result, refusal.reason)


Handler: TypeAlias = Callable[[Command], Outcome]
"""Obeys one kind of command. Must check every parameter that it uses: they may be anything."""


class Entry(NamedTuple):
    """A handler, and how its command may come.

    Attributes:
        frames: MAV_FRAMEs of a COMMAND_INT that it takes; None where the command names no place: x and y then are
            plain numbers, and whatever the frame says is ignored.
        cancel: Called with the command in progress when a COMMAND_CANCEL comes; CANCELLED or ACCEPTED ends it. None
            where it cannot be cancelled so.
        interruptible: Whether such a command is handed on, to update or end it, while another is in progress.
        int_only: Whether a COMMAND_LONG is refused, as one that needs a frame or the precision.
    """

    handler: Handler
    frames: frozenset[int] | None = PLACES
    cancel: Handler | None = None
    interruptible: bool = False
    int_only: bool = False


@dataclass(slots=True)
class _Running:
    command: Command
    progress: int
    report_at_us: int


class _Answered(NamedTuple):
    parameters: tuple[str, ...]
    confirmation: int
    at_us: int
    outcome: Outcome


class CommandService:
    """Hands commands to their handlers and acknowledges each to whoever sent it.

    Attributes:
        closed: Why every command is denied for the time being; empty if they are obeyed.
    """

    handles = frozenset({"COMMAND_LONG", "COMMAND_INT", "COMMAND_CANCEL"})

    def __init__(self, handlers: Mapping[int, Handler | Entry], text: StatusText) -> None:
        """Obey the commands of `handlers`, by MAV_CMD; say with `text` why one is refused.

        A bare handler takes every global frame if MAVLink defines its command as one that goes to a place, and
        ignores the frame if it does not.
        """
        self._entries = {number: _entry(number, handler) for number, handler in handlers.items()}
        self._text = text
        self.closed = ""
        self._running: dict[int, _Running] = {}
        self._report_at_us: int | None = None
        self._answered: dict[tuple[Peer, int], _Answered] = {}
        self._said: tuple[str, int] = ("", -SAME_REASON_AFTER_US)

    def close(self, reason: str) -> None:
        """Deny every command for the time being, for a reason; without one, obey."""
        self.closed = reason

    def receive(self, message: Message, peer: Peer, now_us: int) -> Iterable[Send]:
        """Obey a command, or cancel one."""
        fields = message.fields
        if message.name == "COMMAND_CANCEL":
            return self._cancel(fields.command, peer, now_us)
        if self.closed:
            return [_ack(fields.command, peer, Outcome(DENIED)), *self._reason(Outcome(DENIED, self.closed), now_us)]
        entry = self._entries.get(fields.command)
        if entry is None:
            return [_ack(fields.command, peer, Outcome(UNSUPPORTED))]
        if message.name == "COMMAND_LONG":
            if entry.int_only:
                return [_ack(fields.command, peer, Outcome(COMMAND_INT_ONLY))]
            return self._obey(entry, _from_long(fields, peer, now_us), fields.confirmation)
        if entry.frames is not None and fields.frame not in entry.frames:
            return [_ack(fields.command, peer, Outcome(UNSUPPORTED_MAV_FRAME))]
        return self._obey(entry, _from_int(fields, entry, peer, now_us), 0)

    def poll(self, now_us: int) -> Iterable[Send]:
        """Tell once a second how far the commands in progress are."""
        if self._report_at_us is None or 0 < self._report_at_us - now_us <= PROGRESS_EVERY_US:
            return ()
        sends = []
        for number, running in self._running.items():
            if not 0 < running.report_at_us - now_us <= PROGRESS_EVERY_US:
                running.report_at_us = now_us + PROGRESS_EVERY_US
                sends.append(_progress(number, running))
        self._schedule()
        return sends

    def progress(self, command_id: int, peer: Peer, percent: int) -> None:
        """Note how far the command of `peer` is, 0 to 100."""
        running = self._running.get(command_id)
        if running is not None and running.command.peer == peer:
            running.progress = max(0, min(100, percent))

    def finish(self, command_id: int, peer: Peer, outcome: Outcome) -> list[Send]:
        """Return the last COMMAND_ACK of the command of `peer` that was in progress; nothing if none was."""
        running = self._running.get(command_id)
        if running is None or running.command.peer != peer:
            return []
        self._forget(command_id)
        now_us = running.command.now_us
        self._remember(running.command, 0, outcome, now_us)
        return [_ack(command_id, peer, outcome), *self._reason(outcome, now_us)]

    def _obey(self, entry: Entry, command: Command, confirmation: int) -> list[Send]:
        """Obey a command unless it was sent again only because its answer got lost, or another is in progress.

        "If no acknowledgement is received the command must be automatically re-sent", with a larger confirmation.
        """
        running = self._running.get(command.id)
        if running is not None:
            if running.command.peer == command.peer and _parameters(running.command) == _parameters(command):
                return [_progress(command.id, running)]
            if not entry.interruptible:
                return [_ack(command.id, command.peer, Outcome(TEMPORARILY_REJECTED))]
        before = self._answered.get((command.peer, command.id))
        if before is not None and _is_sent_again(command, confirmation, before):
            self._remember(command, confirmation, before.outcome, before.at_us)
            return [_ack(command.id, command.peer, before.outcome)]
        outcome = entry.handler(command)
        sends = self._interrupt(running, command, outcome) if running is not None else []
        if outcome.result in (IN_PROGRESS, LATER):
            self._running[command.id] = _Running(command, outcome.progress, command.now_us + PROGRESS_EVERY_US)
            self._schedule()
        else:
            self._remember(command, confirmation, outcome, command.now_us)
        if outcome.result == LATER:
            return sends
        return [*sends, _ack(command.id, command.peer, outcome), *self._reason(outcome, command.now_us)]

    def _interrupt(self, running: _Running, command: Command, outcome: Outcome) -> list[Send]:
        """Forget the command in progress that another has replaced or ended; notify its sender if that is another."""
        if outcome.result not in (ACCEPTED, IN_PROGRESS, LATER, CANCELLED) or command.id not in self._running:
            return []
        self._forget(command.id)
        peer = running.command.peer
        return [] if peer == command.peer else [_ack(command.id, peer, Outcome(CANCELLED))]

    def _cancel(self, command_id: int, peer: Peer, now_us: int) -> list[Send]:
        """Cancel what is in progress: its sender gets CANCELLED. "If it has already completed [it] can be ignored"."""
        running, entry = self._running.get(command_id), self._entries.get(command_id)
        if running is None or entry is None:
            return []
        owner = running.command.peer
        outcome = entry.cancel(running.command._replace(now_us=now_us)) if entry.cancel else Outcome(IN_PROGRESS)
        if outcome.result not in (ACCEPTED, CANCELLED):
            # It goes on, and so do its progress reports.
            return [_ack(command_id, peer, Outcome(IN_PROGRESS, progress=running.progress))]
        self._forget(command_id)
        cancelled = outcome._replace(result=CANCELLED)
        return [_ack(command_id, each, cancelled) for each in dict.fromkeys((owner, peer))]

    def _forget(self, command_id: int) -> None:
        self._running.pop(command_id, None)
        self._schedule()

    def _schedule(self) -> None:
        self._report_at_us = min((running.report_at_us for running in self._running.values()), default=None)

    def _remember(self, command: Command, confirmation: int, outcome: Outcome, at_us: int) -> None:
        key = (command.peer, command.id)
        self._answered.pop(key, None)
        if len(self._answered) >= MAX_REMEMBERED:
            del self._answered[next(iter(self._answered))]
        self._answered[key] = _Answered(_parameters(command), confirmation, at_us, outcome)

    def _reason(self, outcome: Outcome, now_us: int) -> list[Send]:
        """Tell everybody why a command was refused, the same reason not more than once a second."""
        if not outcome.reason or outcome.result not in _REFUSED:
            return []
        reason, at_us = self._said
        if reason == outcome.reason and 0 <= now_us - at_us < SAME_REASON_AFTER_US:
            return []
        self._said = (outcome.reason, now_us)
        return self._text.say(ERROR if outcome.result == FAILED else WARNING, outcome.reason)


def _entry(number: int, handler: Handler | Entry) -> Entry:
    if isinstance(handler, Entry):
        return handler
    definition = mav.enums["MAV_CMD"].get(number)
    return Entry(handler, PLACES if definition is not None and definition.has_location else None)


def _from_long(fields: Any, peer: Peer, now_us: int) -> Command:
    numbers = (fields.param1, fields.param2, fields.param3, fields.param4, fields.param5, fields.param6, fields.param7)
    return Command(fields.command, *numbers, None, peer, now_us)


def _from_int(fields: Any, entry: Entry, peer: Peer, now_us: int) -> Command:
    """Bring x and y into degrees or metres: "PARAM5 / local: x position in meters * 1e4, global: latitude * 10^7"."""
    if entry.frames is None:
        scale = 1.0
    elif fields.frame in GLOBAL_FRAMES:
        scale = DEGREES
    else:
        scale = nan if fields.frame == mav.MAV_FRAME_MISSION else METRES
    x, y = (nan if number == NOT_GIVEN else number * scale for number in (fields.x, fields.y))
    numbers = (fields.param1, fields.param2, fields.param3, fields.param4, x, y, fields.z)
    return Command(fields.command, *numbers, fields.frame, peer, now_us)


def _parameters(command: Command) -> tuple[str, ...]:
    """Return what distinguishes a command from another of its kind; as text, in which nan equals itself."""
    return tuple(map(repr, command[1:9]))


def _is_sent_again(command: Command, confirmation: int, before: _Answered) -> bool:
    recent = 0 <= command.now_us - before.at_us < REMEMBERED_FOR_US
    return recent and confirmation > before.confirmation and before.parameters == _parameters(command)


def _ack(command_id: int, peer: Peer, outcome: Outcome) -> Send:
    """Return the COMMAND_ACK to the sender. Only a command in progress has a progress."""
    progress = outcome.progress if outcome.result == IN_PROGRESS else 0
    return to(peer, "COMMAND_ACK", command_id, outcome.result, progress, outcome.param2, peer.system, peer.component)


def _progress(command_id: int, running: _Running) -> Send:
    return _ack(command_id, running.command.peer, Outcome(IN_PROGRESS, progress=running.progress))
