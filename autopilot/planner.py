"""Setpoints: a track, tabulated before the flight, handed out as a horizon."""

from dataclasses import dataclass

import numpy as np

from autopilot.controller import Horizon, Preview
from autopilot.profile import References
from autopilot.tracks import DURATION_S, Array, Track, position

_VERTICAL_SPEED_DECIMALS = 8


@dataclass(frozen=True, slots=True)
class Planner:
    """References at equal intervals along a track; after its end the last point is held.

    Attributes:
        preview: What a horizon is made of.
        samples: How many references the track has.
        table: The references, and as many of the end as a horizon may reach beyond it.
    """

    preview: Preview
    samples: int
    table: Horizon

    def horizon(self, time_us: int) -> Horizon:
        """Return the reference of the sample that `time_us` lies in, and those that follow it."""
        first = min(time_us // self.preview.interval_us, self.samples)
        ahead = slice(first, first + self.preview.samples)
        return Horizon(*(column[ahead] for column in self.table))


def plan(track: Track, references: References, preview: Preview) -> Planner:
    """Tabulate a track as often as `preview` asks, by its formula or by differences."""
    last = round(DURATION_S * 1e6) // preview.interval_us
    t: Array = preview.interval_us * 1e-6 * np.arange(last + 1, dtype=np.float64)
    table = _by_differences(track, t) if references == "by-differences" else _by_formula(track, t)
    return Planner(preview, len(t), _held(table, preview.samples))


def start_yaw(track: Track, references: References) -> float:
    """Return the first yaw reference, rad: with it a flight starts."""
    return float(plan(track, references, Preview(interval_us=100_000, samples=1)).table.yaw_rad[0])


def _by_formula(track: Track, t: Array) -> Horizon:
    """Every derivative exactly, yaw along the horizontal velocity."""
    velocity, acceleration = position(track, t, 1), position(track, t, 2)
    (vx, vy), (ax, ay) = velocity[:, :2].T, acceleration[:, :2].T
    squared = vx * vx + vy * vy
    turning = np.divide(vx * ay - vy * ax, squared, out=np.zeros_like(squared), where=squared > 0.0)
    yaw = np.unwrap(np.mod(np.arctan2(vy, vx), 2.0 * np.pi))
    return Horizon(position(track, t), velocity, acceleration, position(track, t, 3), yaw, turning)


def _by_differences(track: Track, t: Array) -> Horizon:
    """Velocity and yaw from the step before, as the thesis has them.

    Velocity is the backward difference (the first sample's the forward one); yaw points along the horizontal one, but
    for the first sample's, which is the tangent of a circle about the origin. There are no higher derivatives.
    """
    points = position(track, t)
    backward = np.diff(points, axis=0) / (t[1] - t[0])
    velocity = np.concatenate([backward[:1], backward])
    velocity[:, 2] = np.round(velocity[:, 2], _VERTICAL_SPEED_DECIMALS)
    x, y = points[:, 0], points[:, 1]
    first = np.arctan2(y[:1], x[:1]) + np.pi / 2.0
    yaw = np.unwrap(np.mod(np.concatenate([first, np.arctan2(np.diff(y), np.diff(x))]), 2.0 * np.pi))
    none = np.zeros_like(points)
    return Horizon(points, velocity, none, none, yaw, np.zeros_like(yaw))


def _held(table: Horizon, count: int) -> Horizon:
    """Append `count` references that stay at the last point."""

    def stay(column: Array) -> Array:
        return np.concatenate([column, np.repeat(column[-1:], count, axis=0)])

    def stop(column: Array) -> Array:
        return np.concatenate([column, np.zeros((count, *column.shape[1:]))])

    return Horizon(
        position_enu_m=stay(table.position_enu_m),
        velocity_enu_m_s=stop(table.velocity_enu_m_s),
        acceleration_enu_m_s2=stop(table.acceleration_enu_m_s2),
        jerk_enu_m_s3=stop(table.jerk_enu_m_s3),
        yaw_rad=stay(table.yaw_rad),
        yaw_rate_rad_s=stop(table.yaw_rate_rad_s),
    )
