"""The inertial samples and measurements that the filter, which runs behind by the delay of GPS, has yet to take."""

from collections import deque
from typing import NamedTuple

import numpy as np

from colibri.autopilot.estimation.eskf_predict import SAMPLE
from colibri.autopilot.estimation.measurements.instrument import Value
from colibri.autopilot.estimation.sensing.inertial import Reading, sample_between
from colibri.common.types import Array

_BRIDGED_S = 0.1
"""A longer gap between two frames is crossed without what was measured at its ends."""


class Waiting(NamedTuple):
    """What each instrument measured at the end of a sample that the filter has not come to."""

    time_us: int
    values: list[Value | None] | None


class DelayBuffer:
    """A ring of inertial samples, and beside it what was measured at the end of each that waits.

    Attributes:
        samples: The ring, (n, SAMPLE).
        first: Row of the first sample that waits.
        waiting: What was measured, oldest first.
    """

    def __init__(self, samples: int) -> None:
        self.samples: Array = np.zeros((samples, SAMPLE))
        self.first = 0
        self.waiting: deque[Waiting] = deque()

    def is_full(self) -> bool:
        """Whether a sample must be taken before the next is put in."""
        return len(self.waiting) == len(self.samples)

    def put(self, before: Reading, after: Reading, interval_s: float, measured: Waiting) -> None:
        """Add the sample between two readings, and what was measured at its end."""
        if interval_s > _BRIDGED_S:
            before = before._replace(force_good=False, rate_good=False)
        last = (self.first + len(self.waiting)) % len(self.samples)
        self.samples[last] = sample_between(before, after, interval_s)
        self.waiting.append(measured)

    def take(self) -> Waiting:
        """Remove the oldest sample; return what was measured at its end."""
        self.first = (self.first + 1) % len(self.samples)
        return self.waiting.popleft()
