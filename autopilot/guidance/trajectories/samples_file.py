"""Externally sampled tracks, flown unchanged."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from colibri.autopilot.guidance.trajectories.csv_table import CsvTable, TrackFileError, read_table
from colibri.autopilot.guidance.trajectories.local_fit import local_fit
from colibri.common.types import Array

_PLACE, _VELOCITY, _ACCELERATION = ("x", "y", "z"), ("vx", "vy", "vz"), ("ax", "ay", "az")
_REQUIRED = ("t", *_PLACE)
_OPTIONAL = (*_VELOCITY, *_ACCELERATION, "yaw")
_SMOOTHED_S = 0.5
"""Time span of the samples that a derivative follows from."""
_MIN_STEP_S = 1e-3
_TOLERANCE = 0.1
"""Allowed contradiction between columns, relative to the change between rows."""
_LEAST_SMOOTHED = 7
_ROUNDING_M, _ROUNDING_M_S = 0.005, 0.05


@dataclass(frozen=True, slots=True)
class SampledTrack:
    """Times from 0, s, (n,), position to acceleration, ENU, (n, 3, 3), and yaw, unwrapped, or along the path.

    Attributes:
        note: What was derived, for the user.
    """

    times_s: Array
    motion_enu: Array
    yaw_rad: Array | None
    note: str = ""


def read_samples(path: Path, text: str | None = None) -> SampledTrack:
    """Read columns t, x, y, z, vx, vy, vz, ax, ay, az (s, m, ENU), and yaw (degrees), or raise TrackFileError.

    Without accelerations, velocities and accelerations follow from smoothed positions.
    """
    table = read_table(path, _REQUIRED, _OPTIONAL, text)
    times_s = table.times(_MIN_STEP_S)
    for columns in (_VELOCITY, _ACCELERATION):
        for column in columns:
            if column not in table.values and any(other in table.values for other in (*columns, *_ACCELERATION)):
                raise TrackFileError(f"{path}: line 1, column {column}: missing")
    known = [table.matrix(columns) for columns in (_PLACE, _VELOCITY, _ACCELERATION) if columns[0] in table.values]
    if len(known) == len(_PLACE):
        motion = np.stack(known, axis=1)
        _check(table, np.diff(times_s)[:, None], motion)
        return SampledTrack(times_s, motion, table.yaw_rad)
    count = max(_LEAST_SMOOTHED, round(_SMOOTHED_S / float(np.median(np.diff(times_s)))) | 1)
    smooth, *rates = local_fit(times_s, known[0], count)
    motion = np.stack([smooth, *rates], axis=1)
    note = f"{path}: smoothed, by at most {np.abs(smooth - known[0]).max():.2g} m; velocity and acceleration follow"
    return SampledTrack(times_s, motion, table.yaw_rad, note)


def columns_of(times_s: Array, motion: Mapping[str, Array]) -> str:
    """Return the text of a file of samples; yaw in rad."""
    names = (*_REQUIRED, *_VELOCITY, *_ACCELERATION, *(("yaw",) if "yaw" in motion else ()))
    parts = [motion["position"], motion["velocity"], motion["acceleration"]]
    yaw = [np.degrees(motion["yaw"])] if "yaw" in motion else []
    rows = np.concatenate([times_s[:, None], *parts, *yaw], axis=1).tolist()
    return "\n".join([",".join(names), *(",".join(map(repr, row)) for row in rows)]) + "\n"


def _check(table: CsvTable, steps_s: Array, motion: Array) -> None:
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
            raise table.error(row + 1, columns[axis], f"{what}: the columns disagree, or the rows are too far apart")
