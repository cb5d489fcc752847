"""Base of all conversations with a vehicle."""

from abc import ABC, abstractmethod
from collections.abc import Hashable, Sequence
from typing import Any, ClassVar, NamedTuple, TypeAlias

from colibri.mavlink.wire.dialect import Message

Target: TypeAlias = tuple[int, int]  # system and component id of a vehicle's autopilot
Encoded: TypeAlias = tuple[str, tuple[Any, ...]]  # name and fields of an outgoing message

OK = 0  # ACCEPTED or NO_ERROR: the same number in MAV_RESULT, MAV_MISSION_RESULT and MAV_PARAM_ERROR
UNANSWERED = -1  # the result of a conversation without any answer
_AT_ONCE = -(2**63)


class Repeat(NamedTuple):
    every_us: int = 500_000
    tries: int = 10  # without any answer


USUALLY = Repeat()


class Conversation(ABC):
    """A request to a vehicle, repeated until the result."""

    answers: ClassVar[frozenset[str]]  # names of messages

    def __init__(self, target: Target, lane: Hashable, repeat: Repeat) -> None:
        self.target = target
        self.lane = lane  # distinguishes its answers from others', see `client`
        self.result: int | None = None  # the protocol's code, or UNANSWERED
        self._repeat = repeat
        self._sent = self._now_us = 0
        self._due_us = _AT_ONCE

    @property
    def accepted(self) -> bool:
        return self.result == OK

    def poll(self, now_us: int) -> Sequence[Encoded]:
        if self.result is not None or now_us < self._due_us:
            return ()
        if self._sent >= self._repeat.tries:
            self.result = UNANSWERED
            return ()
        self._sent += 1
        self._due_us = now_us + self._repeat.every_us
        return self._request()

    def receive(self, message: Message, now_us: int) -> None:
        self._now_us = now_us
        self._read(message)

    @abstractmethod
    def _read(self, message: Message) -> None: ...

    @abstractmethod
    def _request(self) -> Sequence[Encoded]:
        """Return the current request; `_sent` counts it."""

    def _go_on(self) -> None:
        self._sent, self._due_us = 0, _AT_ONCE

    def _wait(self, longer_us: int) -> None:
        self._sent, self._due_us = 0, self._now_us + longer_us
