"""Commands that are repeated until they are acknowledged, one at a time, as the command microservice has it.

https://mavlink.io/en/services/command.html
"""

from collections import deque
from typing import NamedTuple

from colibri.mavlink.wire.dialect import mav

AGAIN_US = 300_000
TRIES = 5
UNANSWERED = -1
"""In place of a MAV_RESULT: none came."""
_IN_PROGRESS: int = mav.MAV_RESULT_IN_PROGRESS


class Command(NamedTuple):
    """A COMMAND_LONG: its MAV_CMD and seven parameters, and what it is called."""

    name: str
    number: int
    params: tuple[float, ...]


class CommandQueue:
    """Sends commands one after the other.

    Attributes:
        results: The MAV_RESULT of each that ended, or UNANSWERED, by name.
    """

    def __init__(self) -> None:
        """Begin idle."""
        self._waiting: deque[Command] = deque()
        self._current: Command | None = None
        self._tries = 0
        self._again_us = 0
        self.results: dict[str, int] = {}

    @property
    def idle(self) -> bool:
        """Whether nothing is left to be sent."""
        return self._current is None and not self._waiting

    def ask(self, name: str, number: int, *params: float) -> None:
        """Have a command sent, unless one of its name is on its way."""
        on_way = (self._current, *self._waiting)
        if any(command is not None and command.name == name for command in on_way):
            return
        self.results.pop(name, None)
        self._waiting.append(Command(name, number, (*params, *(0.0,) * (7 - len(params)))))

    def clear(self) -> None:
        """Forget what is on its way."""
        self._waiting.clear()
        self._current = None

    def poll(self, now_us: int) -> list[tuple[int, int, tuple[float, ...]]]:
        """Return number, confirmation and parameters of what is to be sent now."""
        if self._current is None and self._waiting:
            self._current, self._tries, self._again_us = self._waiting.popleft(), 0, now_us
        command = self._current
        if command is None or now_us < self._again_us:
            return []
        if self._tries >= TRIES:
            self._end(UNANSWERED)
            return []
        self._tries += 1
        self._again_us = now_us + AGAIN_US
        return [(command.number, min(self._tries - 1, 255), command.params)]

    def receive(self, number: int, result: int) -> None:
        """Take in a COMMAND_ACK."""
        if self._current is not None and number == self._current.number and result != _IN_PROGRESS:
            self._end(result)

    def _end(self, result: int) -> None:
        if self._current is not None:
            self.results[self._current.name] = result
        self._current = None
