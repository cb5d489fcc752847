"""A control law that is slow, simulated: what it decides takes effect a declared time after its sample.

While it solves, the command before is held, and samples that fall due meanwhile are skipped, as a real overrun would
skip them. Nothing here is measured: the same declared time gives the same flight.
"""

from colibri.autopilot.core.step import STILL
from colibri.common.types import FourRotors


class SolveTime:
    """One solver, busy or not.

    Attributes:
        missed: How many decisions took longer than a control interval.
    """

    def __init__(self, interval_us: int) -> None:
        """Be idle; a decision is due every `interval_us`."""
        self._interval_us = interval_us
        self._ready_us: int | None = None
        self._next = self._now = STILL
        self.missed = 0

    def busy(self, now_us: int) -> bool:
        """Whether a decision of an earlier sample is still being made."""
        self.controls(now_us)
        return self._ready_us is not None

    def decided(self, controls: FourRotors, now_us: int, solve_us: int) -> None:
        """Take the command of the sample at `now_us`, which takes so long to solve."""
        if solve_us > self._interval_us:
            self.missed += 1
        self._next, self._ready_us = controls, now_us + solve_us

    def at_once(self, controls: FourRotors) -> None:
        """Command what needs no solving, and forget what was being solved."""
        self._now, self._ready_us = controls, None

    def controls(self, now_us: int) -> FourRotors:
        """Return the command that holds now."""
        if self._ready_us is not None and now_us >= self._ready_us:
            self._now, self._ready_us = self._next, None
        return self._now
