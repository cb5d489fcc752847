"""Waypoint files: points, and balls or windows to fly through in their place."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from colibri.autopilot.guidance.trajectories.csv_table import CsvTable, TrackFileError, read_table
from colibri.common import elementwise
from colibri.common.types import Array

DEFAULT_SPEED_M_S = 2.0
MARGIN = 0.1  # part of each range reserved for the control law, also against wind
MIN_LEG_S = 0.05

_INSIDE = 0.999  # at the edge of an opening itself the slope of a variable vanishes
_REQUIRED = ("x", "y", "z")
_OPTIONAL = ("t", "yaw", *(_WINDOW := ("width", "height", "facing")))


@dataclass(frozen=True, slots=True)
class Openings:
    """What each waypoint is widened to: all that `centres + axes · q` reaches for q in a unit ball, or a unit box."""

    centres_enu_m: Array  # (n, 3)
    axes_m: Array  # half axes in columns, ENU, (n, 3, 3); 0 where a point is kept
    together: Array  # 1 for a ball, (3, 3); the identity for a box

    def points(self, u: Array) -> Array:
        """Return points, ENU, (n, 3), of unbounded variables, (n, 3)."""
        points: Array = self.centres_enu_m + _applied(self.axes_m, 2.0 * u / self._spread(u))
        return points

    def variables(self, points: Array) -> Array:
        """Return the variables, (n, 3), of points inside."""
        length = np.maximum((self.axes_m * self.axes_m).sum(axis=1), 1e-12)
        q = _INSIDE * _applied(np.swapaxes(self.axes_m, 1, 2), points - self.centres_enu_m) / length
        variables: Array = q / (1.0 + np.sqrt(np.maximum(1.0 - _applied(self.together, q * q), 0.0)))
        return variables

    def slopes(self, u: Array, of_points: Array) -> Array:
        """Return the slopes with the variables, (n, 3), from those with the points."""
        spread, pull = self._spread(u), _applied(np.swapaxes(self.axes_m, 1, 2), of_points)
        slopes: Array = 2.0 * pull / spread - 4.0 * u * _applied(self.together, pull * u / (spread * spread))
        return slopes

    def _spread(self, u: Array) -> Array:
        return 1.0 + _applied(self.together, u * u)


@dataclass(frozen=True, slots=True)
class Waypoints:
    """Points, ENU, (n, 3), with times, (n,), and yaw, unwrapped, or along the path."""

    path: Path
    times_s: Array
    points_enu_m: Array
    yaw_rad: Array | None
    timed: bool  # whether the file prescribes the times
    fastest: bool = False
    margin: float = MARGIN
    openings: Openings | None = None  # what is flown through at the points, with `fastest`
    facing: Array | None = None  # directions through windows, ENU, (n, 3); 0 without one

    def stretched(self, factors: Array) -> "Waypoints":
        return replace(self, times_s=np.concatenate([[0.0], np.cumsum(factors * np.diff(self.times_s))]))

    def leg_at(self, t: float) -> int:
        return int(np.searchsorted(self.times_s[1:-1], t, side="right"))

    def error(self, what: str) -> TrackFileError:
        return TrackFileError(f"{self.path}: {what}")


def read_waypoints(
    path: Path,
    speed_m_s: float | Literal["max"] | None = None,
    margin: float | None = None,
    text: str | None = None,
    tolerance_m: float | None = None,
) -> Waypoints:
    """Read columns x, y, z (m, ENU) and optionally t (s) and yaw (degrees), or raise TrackFileError.

    Without t, legs are flown at an average of `speed_m_s`, the first and last at half of it. With "max", points between
    the ends are balls of radius `tolerance_m`, or windows by columns width, height (m) and facing (degrees from east).
    """
    table = read_table(path, _REQUIRED, _OPTIONAL, text)
    points, timed = table.matrix(_REQUIRED), "t" in table.values
    for option, value in (("speed", speed_m_s), ("margin", margin)):
        if timed and value is not None:
            raise TrackFileError(f"{path}: line 1, column t: sets the times: leave {option} out")
    fastest = speed_m_s == "max"
    average_m_s = speed_m_s if isinstance(speed_m_s, float) else DEFAULT_SPEED_M_S
    times_s = table.times(MIN_LEG_S) if timed else _times(table, points, average_m_s)
    margin = MARGIN if margin is None else margin
    waypoints = Waypoints(path, times_s, points, table.yaw_rad, timed, fastest, margin)
    windows = [column for column in _WINDOW if column in table.values]
    if not fastest and tolerance_m is not None:
        raise TrackFileError(f"{path}: option tolerance needs speed=max")
    if windows and (tolerance_m is not None or len(windows) < len(_WINDOW)):
        raise TrackFileError(f"{path}: line 1: columns {', '.join(_WINDOW)} belong together, without option tolerance")
    if not fastest or (tolerance_m is None and not windows):
        return waypoints
    if tolerance_m is None:
        return _with_windows(waypoints, table)
    axes = np.tile((1.0 - margin) * tolerance_m * np.identity(3), (len(points), 1, 1))
    return _opened(waypoints, axes, np.ones((3, 3)))


def _with_windows(waypoints: Waypoints, table: CsvTable) -> Waypoints:
    sizes = table.matrix(("width", "height"))
    for row, column in np.argwhere(sizes < 0.0)[:1]:
        raise table.error(row, _WINDOW[column], f"must be at least 0 m, not {sizes[row, column]:g}")
    facing = np.radians(table.values["facing"])
    ahead = np.stack([elementwise.cos(facing), elementwise.sin(facing), np.zeros(len(facing))], axis=1)
    axes = np.zeros((len(facing), 3, 3))
    half = 0.5 * (1.0 - waypoints.margin) * sizes
    axes[:, 0, 0], axes[:, 1, 0], axes[:, 2, 1] = -half[:, 0] * ahead[:, 1], half[:, 0] * ahead[:, 0], half[:, 1]
    ahead[~sizes.any(axis=1)] = 0.0
    return replace(_opened(waypoints, axes, np.identity(3)), facing=ahead)


def _opened(waypoints: Waypoints, axes: Array, together: Array) -> Waypoints:
    axes[[0, -1]] = 0.0
    return replace(waypoints, openings=Openings(waypoints.points_enu_m, axes, together))


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


def _applied(matrices: Array, vectors: Array) -> Array:
    applied: Array = (matrices * vectors[:, None]).sum(axis=-1)
    return applied
