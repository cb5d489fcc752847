"""Inertial samples and measurements that wait for the delayed filter."""

from collections import deque
from typing import NamedTuple

import numpy as np

from colibri.autopilot.estimation.eskf_predict import SAMPLE
from colibri.autopilot.estimation.measurements.instrument import Value
from colibri.autopilot.estimation.sensing.inertial import Reading, sample_between
from colibri.common.types import Array

_BRIDGED_S = 0.1
"""Longer gaps between frames are crossed without the measurements at their ends."""


class Waiting(NamedTuple):
    """Measurements at the end of a sample, one for each instrument."""

    time_us: int
    values: list[Value | None] | None


class DelayBuffer:
    """A ring of inertial samples, (n, SAMPLE), with the measurements at their ends."""

    def __init__(self, samples: int) -> None:
        self.samples: Array = np.zeros((samples, SAMPLE))
        self.first = 0
        self.waiting: deque[Waiting] = deque()

    def put(self, before: Reading, after: Reading, interval_s: float, measured: Waiting) -> None:
        if interval_s > _BRIDGED_S:
            before = before._replace(force_good=False, rate_good=False)
        last = (self.first + len(self.waiting)) % len(self.samples)
        self.samples[last] = sample_between(before, after, interval_s)
        self.waiting.append(measured)

    def take(self) -> Waiting:
        self.first = (self.first + 1) % len(self.samples)
        return self.waiting.popleft()
