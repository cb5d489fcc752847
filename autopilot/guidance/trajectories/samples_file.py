"""Externally sampled tracks, flown unchanged."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from colibri.autopilot.guidance.trajectories.csv_table import CsvTable, read_table
from colibri.common.types import Array

_PLACE, _VELOCITY, _ACCELERATION = ("x", "y", "z"), ("vx", "vy", "vz"), ("ax", "ay", "az")
_REQUIRED = ("t", *_PLACE, *_VELOCITY, *_ACCELERATION)
_OPTIONAL = ("yaw",)
_MIN_STEP_S = 1e-3
_TOLERANCE = 0.1
"""Allowed contradiction between columns, relative to the change between rows."""
_ROUNDING_M, _ROUNDING_M_S = 0.005, 0.05


@dataclass(frozen=True, slots=True)
class SampledTrack:
    """Times from 0, s, (n,), position to acceleration, ENU, (n, 3, 3), and yaw, unwrapped, or along the path."""

    times_s: Array
    motion_enu: Array
    yaw_rad: Array | None


def read_samples(path: Path, text: str | None = None) -> SampledTrack:
    """Read columns t, x, y, z, vx, vy, vz, ax, ay, az (s, m, ENU), and yaw (degrees), or raise TrackFileError."""
    table = read_table(path, _REQUIRED, _OPTIONAL, text)
    times_s = table.times(_MIN_STEP_S)
    motion = np.stack([table.matrix(columns) for columns in (_PLACE, _VELOCITY, _ACCELERATION)], axis=1)
    _check(table, np.diff(times_s)[:, None], motion)
    return SampledTrack(times_s, motion, table.yaw_rad)


def _check(table: CsvTable, steps_s: Array, motion: Array) -> None:
    """Compare columns by the trapezoidal rule, for positions with the end correction."""
    x, v, a = np.moveaxis(motion, 1, 0)
    goes = np.diff(x, axis=0) + steps_s * steps_s / 12.0 * np.diff(a, axis=0)
    for columns, change, rate, rounding, unit in (
        (_PLACE, goes, v, _ROUNDING_M, "m"),
        (_VELOCITY, np.diff(v, axis=0), a, _ROUNDING_M_S, "m/s"),
    ):
        by_rate = 0.5 * steps_s * (rate[:-1] + rate[1:])
        reach = steps_s * np.maximum(np.abs(rate[:-1]), np.abs(rate[1:]))
        apart = np.abs(change - by_rate)
        allowed = rounding + _TOLERANCE * reach.max(axis=1, keepdims=True)
        for row, axis in np.argwhere(apart > allowed)[:1]:
            by = (_VELOCITY if unit == "m" else _ACCELERATION)[axis]
            what = f"goes by {change[row, axis]:.3g} {unit} from the line before, and {by} by {by_rate[row, axis]:.3g}"
            raise table.error(row + 1, columns[axis], f"{what}: the columns contradict, or rows are far apart")
