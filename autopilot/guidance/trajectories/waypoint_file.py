"""Waypoint files."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from colibri.autopilot.guidance.trajectories.csv_table import CsvTable, TrackFileError, read_table
from colibri.common.types import Array

DEFAULT_SPEED_M_S = 2.0
MARGIN = 0.1
"""Part of each range reserved for the control law, also against wind."""
MIN_LEG_S = 0.05

_REQUIRED = ("x", "y", "z")
_OPTIONAL = ("t", "yaw")


@dataclass(frozen=True, slots=True)
class Waypoints:
    """Points, ENU, (n, 3), with times, (n,), and yaw, unwrapped, or along the path.

    Attributes:
        timed: Whether the file prescribes the times.
        margin: Part of each range reserved for the control law.
    """

    path: Path
    times_s: Array
    points_enu_m: Array
    yaw_rad: Array | None
    timed: bool
    fastest: bool = False
    margin: float = MARGIN

    def stretched(self, factors: Array) -> "Waypoints":
        return self.at(np.concatenate([[0.0], np.cumsum(factors * np.diff(self.times_s))]))

    def at(self, times_s: Array) -> "Waypoints":
        return replace(self, times_s=times_s)

    def leg_at(self, t: float) -> int:
        return int(np.searchsorted(self.times_s[1:-1], t, side="right"))

    def error(self, what: str) -> TrackFileError:
        return TrackFileError(f"{self.path}: {what}")


def read_waypoints(
    path: Path,
    speed_m_s: float | Literal["max"] | None = None,
    margin: float | None = None,
    text: str | None = None,
) -> Waypoints:
    """Read columns x, y, z (m, ENU) and optionally t (s) and yaw (degrees), or raise TrackFileError.

    Without t, legs are flown at an average of `speed_m_s`, the first and last at half of it.
    """
    table = read_table(path, _REQUIRED, _OPTIONAL, text)
    points, timed = table.matrix(_REQUIRED), "t" in table.values
    for option, value in (("speed", speed_m_s), ("margin", margin)):
        if timed and value is not None:
            raise TrackFileError(f"{path}: line 1, column t: sets the times: leave {option} out")
    fastest = speed_m_s == "max"
    average_m_s = speed_m_s if isinstance(speed_m_s, float) else DEFAULT_SPEED_M_S
    times_s = table.times(MIN_LEG_S) if timed else _times(table, points, average_m_s)
    return Waypoints(path, times_s, points, table.yaw_rad, timed, fastest, MARGIN if margin is None else margin)


def leg_times(points_enu_m: Array, speed_m_s: float) -> Array:
    """Return times at points, s, (n,); the first and last leg are at half speed."""
    legs_s = _legs(points_enu_m, speed_m_s)
    legs_s[[0, -1]] *= 2.0
    return np.concatenate([[0.0], np.cumsum(legs_s)])


def _legs(points: Array, speed_m_s: float) -> Array:
    steps = np.diff(points, axis=0)
    legs_s: Array = np.sqrt((steps * steps).sum(axis=1)) / speed_m_s
    return legs_s


def _times(table: CsvTable, points: Array, speed_m_s: float) -> Array:
    for row in np.flatnonzero(_legs(points, speed_m_s) < MIN_LEG_S)[:1] + 1:
        raise table.error(row, "x", f"less than {MIN_LEG_S:g} s from the line before at {speed_m_s:g} m/s")
    times_s = leg_times(points, speed_m_s)
    table.check_duration("x", times_s)
    return times_s
