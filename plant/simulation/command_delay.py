"""Which command the rotors follow at each instant: the last that has arrived, also between two frames."""

from collections import deque
from collections.abc import Iterator

from colibri.mavlink.hil.state import ActuatorCommand


class Actuation:
    """Commands on their way to the rotors."""

    def __init__(self, first: ActuatorCommand) -> None:
        """Follow `first` until another arrives."""
        self._now = first
        self._coming: deque[tuple[int, ActuatorCommand]] = deque()

    def arrive(self, from_us: int, command: ActuatorCommand) -> None:
        """Have a command arrive at a simulated time, not before those that were sent earlier."""
        self._coming.append((from_us, command))

    def spans(self, begin_us: int, end_us: int) -> Iterator[tuple[ActuatorCommand, int]]:
        """Yield what is followed from one time to another, and for how long, µs."""
        now_us = begin_us
        while now_us < end_us:
            while self._coming and self._coming[0][0] <= now_us:
                self._now = self._coming.popleft()[1]
            until_us = min(end_us, self._coming[0][0]) if self._coming else end_us
            yield self._now, until_us - now_us
            now_us = until_us
