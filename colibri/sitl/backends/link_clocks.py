"""Clocks of the link between plant and autopilot, while simulated time stands still: what it is late by."""

from time import perf_counter, sleep
from typing import Protocol

_QUICK = 10.0
_SOON_S = 2e-4


class LinkClock(Protocol):
    """What links between plant and autopilot are late by. No flight depends on it."""

    def now_s(self) -> float:
        """Return the time, s."""

    def wait(self, timeout_s: float) -> None:
        """Let time pass, `timeout_s` at most."""


class StoppedClock:
    """The clock of a plant whose autopilot is in this process, too: it goes only while the plant waits."""

    def __init__(self) -> None:
        """Begin at 0."""
        self._now_s = 0.0

    def now_s(self) -> float:
        """Return the time, s."""
        return self._now_s

    def wait(self, timeout_s: float) -> None:
        """Let `timeout_s` pass at once."""
        self._now_s += timeout_s


class QuickClock:
    """The clock where the autopilot is another process, which computes meanwhile: ten times as fast as the wall's.

    Links are late by less, and a plant in the test's process repeats what was lost sooner; what comes twice is dropped.
    """

    def now_s(self) -> float:
        """Return the time, s."""
        return _QUICK * perf_counter()

    def wait(self, timeout_s: float) -> None:
        """Sleep, and see soon whether there is something to do."""
        sleep(min(timeout_s / _QUICK, _SOON_S))
