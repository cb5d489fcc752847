"""Setpoints: a track, sampled as the thesis samples it, handed out as a horizon."""

from dataclasses import dataclass

import numpy as np

from autopilot.tracks import DURATION_S, Array, Track

_VERTICAL_SPEED_DECIMALS = 8


@dataclass(frozen=True, slots=True)
class Horizon:
    """References from now on, `interval_s` apart.

    Attributes:
        interval_s: Time between two references.
        position_enu_m: (n, 3), m, ENU.
        velocity_enu_m_s: (n, 3), m/s, ENU.
        yaw_rad: (n,), counter-clockwise from east, unwrapped.
    """

    interval_s: float
    position_enu_m: Array
    velocity_enu_m_s: Array
    yaw_rad: Array


class SampledPlanner:
    """A track as the thesis plans it: sampled once an outer sample, velocities and yaw by differences.

    Velocity is the backward difference (the first sample's the forward one); yaw points along the horizontal one, but
    for the first sample's, which is the tangent of a circle about the origin. After the end it holds the last point.
    """

    def __init__(self, track: Track, interval_s: float, preview: int) -> None:
        """Sample `track` every `interval_s` over its duration; horizons hold `preview` references."""
        times: Array = interval_s * np.arange(round(DURATION_S / interval_s) + 1, dtype=np.float64)
        position = track(times)
        self._interval_s = interval_s
        self._interval_us = round(interval_s * 1e6)
        self._preview = preview
        self._last = len(times)
        self._position = np.pad(position, ((0, preview), (0, 0)), mode="edge")
        self._velocity = np.pad(_differences(position, interval_s), ((0, preview), (0, 0)))
        self._yaw = np.pad(_yaw(position), (0, preview), mode="edge")

    def horizon(self, time_us: int) -> Horizon:
        """Return the reference of the sample that `time_us` lies in, and those that follow it."""
        first = min(time_us // self._interval_us, self._last)
        ahead = slice(first, first + self._preview)
        return Horizon(self._interval_s, self._position[ahead], self._velocity[ahead], self._yaw[ahead])


def _differences(position: Array, interval_s: float) -> Array:
    backward: Array = np.diff(position, axis=0) / interval_s
    velocity = np.concatenate([backward[:1], backward])
    velocity[:, 2] = np.round(velocity[:, 2], _VERTICAL_SPEED_DECIMALS)
    return velocity


def _yaw(position: Array) -> Array:
    x, y = position[:, 0], position[:, 1]
    first = np.arctan2(y[:1], x[:1]) + np.pi / 2.0
    along = np.arctan2(np.diff(y), np.diff(x))
    return np.unwrap(np.mod(np.concatenate([first, along]), 2.0 * np.pi))
