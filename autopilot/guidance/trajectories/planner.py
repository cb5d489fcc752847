"""Tracks tabulated at equal intervals."""

from functools import lru_cache
from math import hypot, inf

import numpy as np
from numpy.typing import NDArray

from colibri.autopilot.control.interface import Horizon, Preview
from colibri.autopilot.control.profile import References
from colibri.autopilot.guidance.trajectories.taylor import TaylorSeries, atan2
from colibri.autopilot.guidance.trajectories.tracks import Track, position
from colibri.common import elementary, elementwise
from colibri.common.records import tuple_of
from colibri.common.types import Array

_VERTICAL_SPEED_DECIMALS = 8
_SNAP, _YAW_ACCELERATION = 4, 2
_STILL = 1e-3  # speed in m/s (likewise for higher derivatives) below which the direction is undefined
_BLOCK_SAMPLES = 512
_SHARED_SAMPLES = 20_000  # 160 s at 125 Hz; a longer table is not kept
_START = Preview(interval_us=100_000, samples=1)


class Planner:
    """References along a track, then its last point; endless tracks are tabulated in blocks."""

    def __init__(self, track: Track, references: References, preview: Preview) -> None:
        self.preview, self._track, self._references = preview, track, references
        ends_us, interval_us = track.duration_s * 1e6, preview.interval_us
        self._rest = None if ends_us == inf else round(ends_us) // interval_us + 1
        self._length = _BLOCK_SAMPLES if self._rest is None else self._rest + 1
        self._block = 0
        self._ahead: tuple[int, int, Horizon] | None = None
        self.table = self._tabulate(0)

    def horizon(self, time_us: int) -> Horizon:
        sample = time_us // self.preview.interval_us
        block, first = divmod(sample if self._rest is None else min(sample, self._rest), self._length)
        if block != self._block:
            self._block, self.table = block, self._tabulate(block)
        ahead, (p, v, a, j, s, yaw, yaw_rate, yaw_acc) = slice(first, first + self.preview.samples), self.table
        return tuple_of(
            Horizon,
            (p[ahead], v[ahead], a[ahead], j[ahead], s[ahead], yaw[ahead], yaw_rate[ahead], yaw_acc[ahead]),
        )

    def horizon_at(self, time_us: int, grid_us: int) -> Horizon:
        """Return a horizon between instants `grid_us` apart, extrapolated from the one before."""
        if self._ahead and self._ahead[:2] == (time_us, grid_us):
            return self._ahead[2]
        past_us = time_us % grid_us
        horizon = self.horizon(time_us - past_us)
        return carried(horizon, past_us * 1e-6) if past_us else horizon

    def prepare(self, time_us: int, grid_us: int) -> None:
        self._ahead = (time_us, grid_us, self.horizon_at(time_us, grid_us))

    def _tabulate(self, block: int) -> Horizon:
        asked = (self._track, self._references, self.preview, self._length, block)
        if self._length > _SHARED_SAMPLES:
            return _tabulated(*asked)
        shared = (_blocks if self._rest is None else _whole)(*asked)
        return Horizon(*(column.copy() for column in shared))  # laws might write to them


def _tabulated(track: Track, references: References, preview: Preview, length: int, block: int) -> Horizon:
    first, lead = block * length, min(block, 1)
    samples = np.arange(first - lead, first + length + preview.samples, dtype=np.float64)
    interval_s = preview.interval_us * 1e-6
    by = _by_differences if references == "by-differences" else _by_formula
    return Horizon(*(column[lead:] for column in by(track, interval_s * samples, interval_s)))


_whole, _blocks = lru_cache(maxsize=4)(_tabulated), lru_cache(maxsize=64)(_tabulated)
"""Flights along one track share its table, of at most 3 MB, or its blocks, of 0.1 MB."""


def carried(horizon: Horizon, by_s: float) -> Horizon:
    """Extrapolate references by their derivatives."""
    p, v, a, j, s, yaw, yaw_rate, yaw_acceleration = horizon
    half, third, quarter = by_s / 2.0, by_s / 3.0, by_s / 4.0
    return Horizon(
        p + by_s * (v + half * (a + third * (j + quarter * s))),
        v + by_s * (a + half * (j + third * s)),
        a + by_s * (j + half * s),
        j + by_s * s,
        s,
        yaw + by_s * (yaw_rate + half * yaw_acceleration),
        yaw_rate + by_s * yaw_acceleration,
        yaw_acceleration,
    )


@lru_cache(maxsize=16)
def start_yaw(track: Track, references: References) -> float:
    return float(Planner(track, references, _START).horizon(0).yaw_rad[0])


def _by_formula(track: Track, t: Array, interval_s: float) -> Horizon:
    del interval_s
    x, y, z = track.position(track.clock(t, _SNAP))
    derivatives = [np.stack([axis.derivative(order) for axis in (x, y, z)], axis=-1) for order in range(_SNAP + 1)]
    if track.yaw is None:
        looks = _along(x, y)
    else:
        yaw = track.yaw(track.clock(t, _YAW_ACCELERATION))
        looks = [yaw.derivative(order) for order in range(_YAW_ACCELERATION + 1)]
    return Horizon(*derivatives, *looks)


def _along(x: TaylorSeries, y: TaylorSeries) -> list[Array]:
    vx, vy = (axis.rate().coefficients[: _YAW_ACCELERATION + 1] for axis in (x, y))
    moving = np.sqrt(vx[0] * vx[0] + vy[0] * vy[0]) >= _STILL
    direction = atan2(TaylorSeries(np.where(moving, vy, 0.0)), TaylorSeries(np.where(moving, vx, 0.0)))
    yaw, known = direction.derivative(0), moving.copy()
    departure = _departure(x, y)
    if departure is not None:
        yaw[0], known[0] = departure, True
    return [_unwrapped(yaw, known), direction.derivative(1), direction.derivative(2)]


def _departure(x: TaylorSeries, y: TaylorSeries) -> float | None:
    for order in range(1, len(x.coefficients)):
        ahead, left = float(x.derivative(order)[0]), float(y.derivative(order)[0])
        if hypot(ahead, left) >= _STILL:
            return elementary.atan2(left, ahead)
    return None


def _unwrapped(yaw: Array, known: NDArray[np.bool_]) -> Array:
    if not known.any():
        return np.zeros_like(yaw)
    latest = np.maximum.accumulate(np.where(known, np.arange(len(yaw)), np.argmax(known)))
    unwrapped: Array = np.unwrap(np.mod(yaw[latest], 2.0 * np.pi))
    return unwrapped


def _by_differences(track: Track, t: Array, interval_s: float) -> Horizon:
    """As in the thesis: backward differences, yaw along them, at first tangential to a circle about the origin."""
    points = position(track, t)
    backward = np.diff(points, axis=0) / interval_s
    velocity = np.concatenate([backward[:1], backward])
    velocity[:, 2] = np.round(velocity[:, 2], _VERTICAL_SPEED_DECIMALS)
    velocity[track.ended(t)] = 0.0
    yaw = _along_differences(points, interval_s) if track.yaw is None else track.yaw(track.clock(t, 0)).derivative(0)
    none = np.zeros_like(points)
    return Horizon(points, velocity, none, none, none, yaw, np.zeros_like(yaw), np.zeros_like(yaw))


def _along_differences(points: Array, interval_s: float) -> Array:
    x, y = points[:, 0], points[:, 1]
    first = elementwise.atan2(y[:1], x[:1]) + np.pi / 2.0
    dx, dy = np.diff(x), np.diff(y)
    known = np.concatenate([[True], np.sqrt(dx * dx + dy * dy) >= _STILL * interval_s])
    return _unwrapped(np.concatenate([first, elementwise.atan2(dy, dx)]), known)
