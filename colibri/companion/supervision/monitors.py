"""Consistency of reported motion, as stale values contradict each other, and the rate of the setpoints."""

from collections import deque
from math import acos, dist
from typing import NamedTuple

from colibri.common.rotations import normalized
from colibri.common.types import Quaternion, Vector
from colibri.mavlink.client.states import TimedState

WINDOW_S = 0.15
MAX_GAP_S, MAX_JUMP_GAP_S = 0.1, 1.0
"""States further apart are not compared, or not for jumps."""
MAX_TURN_RAD, MAX_WAY_M = 0.15, 0.15
"""Largest contradiction in a window: 1 rad/s, 1 m/s."""
_WINDOWS = 2
"""A correction of the estimate contradicts once, stale values again and again."""


class _Start(NamedTuple):
    at_us: int
    state: TimedState


class Consistency:
    """Integrates body rates and velocity over windows.

    Attributes:
        contradiction: In words, or empty.
        jumped_m: Largest jump of the position, until its reader clears it.
    """

    def __init__(self) -> None:
        self.contradiction, self.jumped_m = "", 0.0
        self._start: _Start | None = None
        self._last: _Start | None = None
        self._turned: Quaternion = (1.0, 0.0, 0.0, 0.0)
        self._moved: Vector = (0.0, 0.0, 0.0)
        self._windows = 0

    def add(self, at_us: int, state: TimedState) -> None:
        now, last = _Start(at_us, state), self._last
        self._last = now
        if last is not None and (at_us - last.at_us) * 1e-6 < MAX_JUMP_GAP_S:
            self._judge_jump(last, now)
        if last is None or self._start is None or not 0.0 < (at_us - last.at_us) * 1e-6 <= MAX_GAP_S:
            self._begin(now)
            self._windows, self.contradiction = 0, ""
            return
        passed_s = (at_us - last.at_us) * 1e-6
        p, q, r = _mean(last.state.rate_flu_rad_s, state.rate_flu_rad_s)
        self._turned = _turned(self._turned, (p * passed_s, q * passed_s, r * passed_s))
        vx, vy, vz = _mean(last.state.velocity_enu_m_s, state.velocity_enu_m_s)
        x, y, z = self._moved
        self._moved = (x + vx * passed_s, y + vy * passed_s, z + vz * passed_s)
        if (at_us - self._start.at_us) * 1e-6 >= WINDOW_S:
            self._judge(state)
            self._begin(now)

    def _judge_jump(self, last: _Start, now: _Start) -> None:
        passed_s = (now.at_us - last.at_us) * 1e-6
        (x, y, z), (vx, vy, vz) = last.state.position_enu_m, last.state.velocity_enu_m_s
        there = (x + passed_s * vx, y + passed_s * vy, z + passed_s * vz)
        self.jumped_m = max(self.jumped_m, dist(there, now.state.position_enu_m))

    def _begin(self, now: _Start) -> None:
        self._start, self._turned, self._moved = now, now.state.attitude, now.state.position_enu_m

    def _judge(self, state: TimedState) -> None:
        cosine = abs(sum(a * b for a, b in zip(self._turned, state.attitude, strict=True)))
        turn_rad, way_m = 2.0 * acos(min(cosine, 1.0)), dist(self._moved, state.position_enu_m)
        found = ""
        if turn_rad > MAX_TURN_RAD:
            found = "attitude and body rates"
        elif way_m > MAX_WAY_M:
            found = "position and velocity"
        self._windows = self._windows + 1 if found else 0
        self.contradiction = f"{found} contradict each other" if self._windows >= _WINDOWS else ""


def _mean(a: Vector, b: Vector) -> Vector:
    return (0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2]))


def _turned(q: Quaternion, by_rad: Vector) -> Quaternion:
    w, x, y, z = q
    p, q_, r = (0.5 * angle for angle in by_rad)
    return normalized(
        (w - x * p - y * q_ - z * r, x + w * p + y * r - z * q_, y + w * q_ + z * p - x * r, z + w * r + x * q_ - y * p)
    )


_WINDOW_US = 1_000_000


class SetpointRate:
    """Counts setpoints against those due over the last second."""

    def __init__(self) -> None:
        self._began_us = 0
        self._sent_us: deque[int] = deque()

    def begin(self, now_us: int) -> None:
        self._began_us = now_us
        self._sent_us.clear()

    def count(self, now_us: int) -> None:
        self._sent_us.append(now_us)
        while self._sent_us[0] <= now_us - _WINDOW_US:
            self._sent_us.popleft()

    def gap_s(self, now_us: int) -> float:
        last_us = self._sent_us[-1] if self._sent_us else self._began_us
        return (now_us - last_us) * 1e-6

    def kept(self, now_us: int, interval_us: int) -> float:
        """Return the part of the last second's setpoints that was computed, 1 at first."""
        if now_us - self._began_us < _WINDOW_US:
            return 1.0
        there = sum(1 for at_us in self._sent_us if at_us > now_us - _WINDOW_US)
        return there * interval_us / _WINDOW_US
