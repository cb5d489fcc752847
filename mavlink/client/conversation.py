"""Base of all conversations with a vehicle: a request, repeated until answered, and its result."""

from abc import ABC, abstractmethod
from collections.abc import Hashable, Sequence
from typing import Any, ClassVar, NamedTuple, TypeAlias

from colibri.mavlink.wire.dialect import Message

Target: TypeAlias = tuple[int, int]
"""System and component id of a vehicle's autopilot."""
Encoded: TypeAlias = tuple[str, tuple[Any, ...]]
"""Name and fields of an outgoing message, in the order of its MAVLink definition, in wire units and frames."""

OK = 0
"""ACCEPTED or NO_ERROR: the same number in MAV_RESULT, MAV_MISSION_RESULT and MAV_PARAM_ERROR."""
UNANSWERED = -1
"""The result of a conversation without any answer."""
_AT_ONCE = -(2**63)


class Repeat(NamedTuple):
    """Repetition of requests.

    Attributes:
        every_us: Time between requests, and after the last one until the vehicle counts as silent.
        tries: Requests without any answer.
    """

    every_us: int = 500_000
    tries: int = 10


USUALLY = Repeat()


class Conversation(ABC):
    """A request to a vehicle and its course until the result.

    A subclass returns the messages of its current request and reads the answers.

    Attributes:
        lane: Distinguishes its answers from others'; see `client`.
        answers: Names of the messages that answer it.
        result: The protocol's result code, or UNANSWERED; `None` until the end.
    """

    answers: ClassVar[frozenset[str]]

    def __init__(self, target: Target, lane: Hashable, repeat: Repeat) -> None:
        self.target = target
        self.lane = lane
        self.result: int | None = None
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
        """Return the current request; `_sent` counts its transmissions including this one."""

    def _go_on(self) -> None:
        """Send the next request at the next poll."""
        self._sent, self._due_us = 0, _AT_ONCE

    def _wait(self, longer_us: int) -> None:
        """Wait for the rest of an answer."""
        self._sent, self._due_us = 0, self._now_us + longer_us
