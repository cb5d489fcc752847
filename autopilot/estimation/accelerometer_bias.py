"""Detection of a sudden accelerometer bias.

A sudden bias b makes GPS velocity innovations a ramp y = y₀ - ∫R dt · b, rejected fix after fix; b is fitted by least
squares. A faulty receiver also makes ramps, so a second sensor must agree: across the body, the accelerometer itself,
because thrust is along z; along body z, the barometer against the integrated velocity.

PX4's EKF2 checks vertical acceleration likewise. Test: A. Willsky, H. Jones, IEEE TAC 21 (1976).
"""

from collections import deque
from itertools import pairwise
from math import ceil, nan, sqrt
from typing import NamedTuple, TypeAlias

import numpy as np

from colibri.autopilot.estimation.measurements.barometer import BarometerFusion
from colibri.autopilot.estimation.measurements.instrument import MeasurementKind
from colibri.common.compiled_rotations import rotation_matrix
from colibri.common.earth.atmosphere import METRES_PER_PASCAL
from colibri.common.elementary import square
from colibri.common.jit import compiled
from colibri.common.types import Array, Matrix
from colibri.plant.vehicle.sensors import Sensors

# Time, µs; state (10,) before the test; velocity innovation; time of the last pressure test, µs; its height, m.
_Fix: TypeAlias = tuple[int, list[float], tuple[float, ...], int, float]

TIME, POSITION, VELOCITY, ATTITUDE, INNOVATION, HEIGHT = 0, 1, 4, 7, 11, 14
ROW = 15  # columns of a fix: time, s, state (10,), velocity innovation, m/s ENU, barometer height, m

_FEWEST_FIXES = 3
_MAX_WINDOW_US = 2_500_000  # since the first rejected fix: later, the filter accepts by force
_KEPT_S = 6.0
_BEFORE_S, _FEWEST_BEFORE = 1.0, 4  # window before the fault for the reference force, and its least fixes
_ONSET_S = 0.05
_MAX_GAP_S = 0.35
_ALONG_PART = 0.5  # part of the bias along body z that requires agreement of the barometer
_ALIKE_PART = 0.5  # two sensors agree if their values differ by at most this part of the larger
_CLEAR = 9.0  # minimum difference between two hypotheses, σ²
_FOUR_SIGMA = 22.06  # χ² of three degrees of freedom
_MIN_SIGMA = 1e-3
_STEPS = 4  # least-squares iterations: the error falls by the square of the angle turned


class DetectedBias(NamedTuple):
    """Detected bias, m/s² FLU, its variance along each axis, and corrections of the filter, ENU."""

    bias_m_s2: Array
    variance: float
    velocity_m_s: Array
    position_m: Array


class AccelerometerWatch:
    def __init__(self, sensors: Sensors, gravity_m_s2: float) -> None:
        self._velocity_variance = square(max(sensors.gps.velocity_noise_m_s, _MIN_SIGMA))
        self._height_variance = square(max(sensors.barometer.noise_pa * METRES_PER_PASCAL, _MIN_SIGMA))
        self._gravity = gravity_m_s2
        self._fixes: deque[_Fix] = deque(maxlen=ceil(_KEPT_S * sensors.gps.rate_hz))
        self._rejected = 0
        self._first_us = 0
        self._resets = 0
        find_bias(np.zeros((_FEWEST_FIXES, ROW)), 0, 1.0, 1.0, gravity_m_s2, np.zeros((3, 3)))

    def look(
        self, time_us: int, state: list[float], velocity: MeasurementKind, barometer: BarometerFusion
    ) -> DetectedBias | None:
        """Check a fix; `state` (10,) is the filter's nominal state before the test."""
        if velocity.resets != self._resets:
            self._resets = velocity.resets
            self._fixes.clear()
        self._fixes.append((time_us, state, velocity.test.innovation, barometer.kind.test.time_us, barometer.height_m))
        if velocity.rejected_us is None:
            self._rejected = 0
            return None
        if self._rejected == 0:
            self._first_us = time_us
        self._rejected += 1
        if self._rejected < _FEWEST_FIXES or time_us - self._first_us > _MAX_WINDOW_US:
            return None
        return self._judge(len(self._fixes) - 1 - self._rejected)

    def _judge(self, first: int) -> DetectedBias | None:
        if first < _FEWEST_BEFORE:
            return None
        rows = np.array(
            [
                (time_us * 1e-6, *state, *innovation, height if tested_us != before_us else nan)
                for (time_us, state, innovation, tested_us, height), (_, _, _, before_us, _) in pairwise(self._fixes)
            ]
        )
        found = np.empty((3, 3))
        variance = find_bias(rows, first, self._velocity_variance, self._height_variance, self._gravity, found)
        return DetectedBias(found[0], variance, found[1], found[2]) if variance > 0.0 else None


@compiled
def find_bias(
    rows: Array, first: int, velocity_variance: float, height_variance: float, gravity: float, found: Array
) -> float:
    """Detect a bias in fixes, (n, 15), from the first rejected one on; return its variance along each axis, or 0.

    The height of a fix is nan without a new pressure. Write bias, FLU, velocity and position errors, ENU, to `found`.
    """
    n = len(rows) - first
    for k in range(1, len(rows)):
        if rows[k, TIME] - rows[k - 1, TIME] > _MAX_GAP_S:
            return 0.0
    A, d = _turned(rows, first), rows[first:, INNOVATION : INNOVATION + 3].copy()
    middle = _centred(d)
    for i in range(3):
        _centred(A[:, i, :])
    bias, spread = _fitted(A, d)
    size = sqrt(bias[0] ** 2 + bias[1] ** 2 + bias[2] ** 2)
    if not size * size * spread > _FOUR_SIGMA * velocity_variance:
        return 0.0
    lacks, rest = np.empty((n, 3)), 0.0
    for k in range(n):
        for i in range(3):
            ramp = -(A[k, i, 0] * bias[0] + A[k, i, 1] * bias[1] + A[k, i, 2] * bias[2])
            rest += (d[k, i] - ramp) ** 2
            lacks[k, i] = middle[i] + ramp
    freedom = 3 * (n - 2)
    if rest > (freedom + 5.0 * sqrt(2.0 * freedom)) * velocity_variance:
        return 0.0
    began_s = sqrt(lacks[0, 0] ** 2 + lacks[0, 1] ** 2 + lacks[0, 2] ** 2) / size
    moved, last = _integrated(rows, first, lacks, lacks[0], 0.5 * began_s), first
    while last >= 0 and rows[last, TIME] > rows[first, TIME] - began_s - _ONSET_S:
        last -= 1
    begin = last
    while begin > 0 and rows[begin - 1, TIME] >= rows[last, TIME] - _BEFORE_S:
        begin -= 1
    if last - begin < _FEWEST_BEFORE - 1:
        return 0.0
    drifted = _integrated(rows, begin, rows[begin:, VELOCITY : VELOCITY + 3].copy(), np.zeros(3), 1.0)
    if abs(bias[2]) > _ALONG_PART * size and not _is_seen(rows, first, begin, last, moved, drifted, height_variance):
        return 0.0
    if not _is_felt(rows, first, begin, last, gravity, bias):
        return 0.0
    for i in range(3):
        drift = drifted[-1, i] - drifted[last - begin, i]
        found[0, i], found[1, i] = bias[i], lacks[-1, i]
        found[2, i] = moved[-1, i] - (rows[-1, POSITION + i] - rows[last, POSITION + i] - drift)
    return velocity_variance / spread


@compiled
def _is_seen(
    rows: Array, first: int, begin: int, last: int, moved: Array, drifted: Array, height_variance: float
) -> bool:
    """Check that the barometer shows the position errors `moved` (n, 3); rows `begin` to `last` precede the fault."""
    rest = 0.0
    for k in range(begin, last + 1):
        rest += (rows[k, HEIGHT] - drifted[k - begin, 2]) / (last + 1 - begin)
    clear, follows = 0.0, 0.0
    for k in range(len(moved)):
        up, row = moved[k, 2], first + k
        clear += up * up
        follows += up * (rows[row, HEIGHT] - drifted[row - begin, 2] - rest)
    return clear >= _CLEAR * height_variance and abs(follows - clear) <= _ALIKE_PART * max(follows, clear)


@compiled
def _is_felt(rows: Array, first: int, begin: int, last: int, gravity: float, bias: Array) -> bool:
    """Check that the lateral specific force shows the bias; rows `begin` to `last` precede the fault."""
    x, y = _mean_felt(rows, first, len(rows) - 1, gravity)
    before_x, before_y = _mean_felt(rows, begin, last, gravity)
    x, y = x - before_x, y - before_y
    felt, size = sqrt(x**2 + y**2), sqrt(bias[0] ** 2 + bias[1] ** 2 + bias[2] ** 2)
    return sqrt((x - bias[0]) ** 2 + (y - bias[1]) ** 2) <= _ALIKE_PART * max(felt, size)


@compiled
def _mean_felt(rows: Array, begin: int, last: int, gravity: float) -> tuple[float, float]:
    """Return the mean specific force along x and y of the body between two fixes."""
    R = np.empty((3, 3))
    total_x, total_y = 0.0, 0.0
    for k in range(begin + 1, last + 1):
        _put_between(rows, k, R)
        dt = rows[k, TIME] - rows[k - 1, TIME]
        x, y = 0.0, 0.0
        for i in range(3):
            along = (rows[k, VELOCITY + i] - rows[k - 1, VELOCITY + i]) / dt + (gravity if i == 2 else 0.0)
            x += R[i, 0] * along
            y += R[i, 1] * along
        total_x, total_y = total_x + x, total_y + y
    return total_x / (last - begin), total_y / (last - begin)


@compiled
def _turned(rows: Array, first: int) -> Array:
    """Return ∫R dt from the first rejected fix to each later one, (n, 3, 3)."""
    A, R = np.zeros((len(rows) - first, 3, 3)), np.empty((3, 3))
    for k in range(1, len(A)):
        dt = rows[first + k, TIME] - rows[first + k - 1, TIME]
        _put_between(rows, first + k, R)
        for i in range(3):
            for j in range(3):
                A[k, i, j] = A[k - 1, i, j] + R[i, j] * dt
    return A


@compiled
def _put_between(rows: Array, k: int, R: Array) -> None:
    """Write the mean rotation from body to earth since the previous fix, (3, 3)."""
    now, before = _rotation(rows[k]), _rotation(rows[k - 1])
    for i in range(3):
        for j in range(3):
            R[i, j] = 0.5 * (now[i][j] + before[i][j])


@compiled
def _rotation(row: Array) -> Matrix:
    return rotation_matrix((row[ATTITUDE], row[ATTITUDE + 1], row[ATTITUDE + 2], row[ATTITUDE + 3]))


@compiled
def _centred(columns: Array) -> Array:
    """Subtract the means of columns (n, 3) in place, and return them."""
    mean = np.zeros(3)
    for i in range(3):
        for k in range(len(columns)):
            mean[i] += columns[k, i]
        mean[i] /= len(columns)
        for k in range(len(columns)):
            columns[k, i] -= mean[i]
    return mean


@compiled
def _fitted(A: Array, d: Array) -> tuple[Array, float]:
    """Return b that minimises |d + A b|², and A's spread, s²; AᵀA is nearly a multiple of the identity."""
    spread = 0.0
    for k in range(len(A)):
        for i in range(3):
            spread += (A[k, i, 0] ** 2 + A[k, i, 1] ** 2 + A[k, i, 2] ** 2) / 3.0
    bias, step = np.zeros(3), np.empty(3)
    for _ in range(_STEPS):
        for j in range(3):
            step[j] = 0.0
        for k in range(len(A)):
            for i in range(3):
                rest = d[k, i] + A[k, i, 0] * bias[0] + A[k, i, 1] * bias[1] + A[k, i, 2] * bias[2]
                for j in range(3):
                    step[j] += rest * A[k, i, j]
        for j in range(3):
            bias[j] -= step[j] / spread
    return bias, spread


@compiled
def _integrated(rows: Array, first: int, velocity: Array, start: Array, part: float) -> Array:
    """Integrate a velocity (n, 3) from `part` of `start` at fix `first` on, m ENU."""
    place = np.empty((len(velocity), 3))
    for i in range(3):
        place[0, i] = part * start[i]
        for k in range(1, len(velocity)):
            dt = rows[first + k, TIME] - rows[first + k - 1, TIME]
            place[k, i] = place[k - 1, i] + 0.5 * dt * (velocity[k - 1, i] + velocity[k, i])
    return place
