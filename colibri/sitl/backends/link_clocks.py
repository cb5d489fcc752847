"""Clocks of the link between plant and autopilot. Flights are independent of them."""

from time import perf_counter, sleep
from typing import Protocol

_QUICK = 10.0
_SOON_S = 2e-4


class LinkClock(Protocol):
    """The clock of the delays between plant and autopilot."""

    def now_s(self) -> float: ...

    def wait(self, timeout_s: float) -> None: ...


class StoppedClock:
    """Advances only while the plant waits: both sides are in this process."""

    def __init__(self) -> None:
        self._now_s = 0.0

    def now_s(self) -> float:
        return self._now_s

    def wait(self, timeout_s: float) -> None:
        self._now_s += timeout_s


class QuickClock:
    """Ten times the wall clock, for an autopilot in another process: lost datagrams are repeated sooner."""

    def now_s(self) -> float:
        return _QUICK * perf_counter()

    def wait(self, timeout_s: float) -> None:
        sleep(min(timeout_s / _QUICK, _SOON_S))
