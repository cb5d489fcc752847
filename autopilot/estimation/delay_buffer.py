"""Inertial samples and measurements that wait for the delayed filter."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from colibri.autopilot.estimation.eskf_predict import BLIND_FORCE, BLIND_RATE, FORCE, RATE, SAMPLE
from colibri.autopilot.estimation.measurements.instrument import Value
from colibri.autopilot.estimation.sensing.inertial import InertialReading, sample_between
from colibri.common.compiled_rotations import rotation_matrix
from colibri.common.jit import compiled
from colibri.common.records import Record
from colibri.common.types import Array, Vector

_FEWEST = 6  # samples that show noise
_LEARNT_PART = 0.1  # of the present force in the mean
_BRIDGED_S = 0.1  # longer gaps between frames are crossed without the measurements at their ends


class Waiting(Record, frozen=True):
    """Measurements at the end of a sample, one for each instrument."""

    time_us: int
    values: list[Value | None] | None


class DelayBuffer:
    """A ring of inertial samples, (n, SAMPLE), with the measurements at their ends."""

    def __init__(self, samples: int) -> None:
        self.samples: Array = np.zeros((samples, SAMPLE))
        self.first = 0
        self.waiting: deque[Waiting] = deque()

    def put(self, before: InertialReading, after: InertialReading, interval_s: float, measured: Waiting) -> None:
        if interval_s > _BRIDGED_S:
            before = before._replace(force_good=False, rate_good=False, force_modelled=False, rate_modelled=False)
        last = (self.first + len(self.waiting)) % len(self.samples)
        self.samples[last] = sample_between(before, after, interval_s)
        self.waiting.append(measured)

    def take(self) -> Waiting:
        self.first = (self.first + 1) % len(self.samples)
        return self.waiting.popleft()

    def median_rate(self) -> Vector:
        p, q, r = np.median(self.samples[self._rows(len(self.waiting)), RATE : RATE + 3], axis=0).tolist()
        return p, q, r

    def add_bias(self, bias: Vector, since: int) -> float:
        """Add a bias, rad/s, to the waiting rates but the last `since`, which have it already.

        Return the duration, s, of the samples with it that the filter has taken.
        """
        rows = self._rows(len(self.waiting) - since)
        self.samples[rows, RATE : RATE + 3] += bias
        self.samples[rows[-1:], RATE : RATE + 3] -= 0.5 * np.array(bias)  # the jump was in this sample
        taken = max(since - len(self.waiting), 0)
        return taken * float(self.samples[self.first, 0])

    def _rows(self, count: int) -> NDArray[np.intp]:
        return np.arange(self.first, self.first + count) % len(self.samples)


@compiled
def roughness(samples: Array, first: int, count: int, force: float, rate: float) -> tuple[float, float]:
    """Return the parts of `count` samples whose second differences exceed those of `force` and `rate`.

    White noise exceeds them in most samples; a knock, even with the standard deviation of noise, in few.
    """
    n, found, rough = len(samples), 0, [0, 0]
    for k in range(2, count):
        a, b, c = (first + k - 2) % n, (first + k - 1) % n, (first + k) % n
        blind = 0.0
        for row in (a, b, c):
            blind += samples[row, BLIND_FORCE] + samples[row, BLIND_RATE]
        if blind > 0.0:
            continue
        found += 1
        for sensor, column, limit in ((0, FORCE, force), (1, RATE, rate)):
            most = 0.0
            for i in range(column, column + 3):
                most = max(most, abs(samples[a, i] - 2.0 * samples[b, i] + samples[c, i]))
            if most > limit:
                rough[sensor] += 1
    if found < _FEWEST:
        return 0.0, 0.0
    return rough[0] / found, rough[1] / found


@compiled
def learn_drag(samples: Array, first: int, count: int, x: Array, drag: Array) -> None:
    """Let `drag` (2,), m/s² east and north, follow the mean force across the thrust while the sensors are good."""
    fx, fy = 0.0, 0.0
    for k in range(first, first + count):
        row = k % len(samples)
        if samples[row, BLIND_FORCE] + samples[row, BLIND_RATE] > 0.0:
            return
        fx += (samples[row, FORCE] - x[13]) / count
        fy += (samples[row, FORCE + 1] - x[14]) / count
    R = rotation_matrix((x[6], x[7], x[8], x[9]))
    for i in range(2):
        drag[i] += _LEARNT_PART * (R[i][0] * fx + R[i][1] * fy - drag[i])
