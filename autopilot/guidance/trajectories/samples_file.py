"""Externally sampled tracks, flown unchanged."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import degrees
from pathlib import Path

import numpy as np

from colibri.autopilot.guidance.trajectories.csv_table import CsvTable, TrackFileError, read_table
from colibri.common.errors import shown
from colibri.common.types import Array

_PLACE, _VELOCITY, _ACCELERATION = ("x", "y", "z"), ("vx", "vy", "vz"), ("ax", "ay", "az")
_REQUIRED = ("t", *_PLACE)
_OPTIONAL = (*_VELOCITY, *_ACCELERATION, "yaw")
_SMOOTHED_S = 0.5  # time span of the samples that a derivative follows from
_DEGREE = 4  # of the polynomials
_MIN_STEP_S = 1e-3
_TOLERANCE = 0.1  # allowed contradiction between columns, relative to the change between rows
_LEAST_SMOOTHED = 7
_ROUNDING_M, _ROUNDING_M_S = 0.005, 0.05
_PEAK = 10.0 / 3.0**0.5
"""Of 60 τ - 180 τ² + 120 τ³, the acceleration between two rows for positions off by 1 m, a second apart."""
_ROUGH_M_S2 = 2.0
_FORMS = {
    "{}": ("{}", "p{}", "p_{}", "pos_{}", "position_{}", "{}_m"),
    "v{}": ("v{}", "v_{}", "vel_{}", "velocity_{}", "{}_dot", "v{}_m_s"),
    "a{}": ("a{}", "a_{}", "acc_{}", "acceleration_{}", "{}_ddot", "a_lin_{}", "a{}_m_s2"),
}
_ALIASES = {
    **dict.fromkeys(("time", "time_s", "t_s", "timestamp", "seconds"), ("t", 1.0)),
    **{form.format(xyz): (name.format(xyz), 1.0) for name, forms in _FORMS.items() for form in forms for xyz in _PLACE},
    **dict.fromkeys(("yaw_deg", "heading_deg", "psi_deg"), ("yaw", 1.0)),
    **dict.fromkeys(("yaw_rad", "psi", "psi_rad"), ("yaw", degrees(1.0))),
}
"""Names of planners: Agilicious and TOGT-Planner (p_x, v_x, a_lin_x), RotorPy (x_dot), `flight.csv` (psi, rad)."""


@dataclass(frozen=True, slots=True)
class SampledTrack:
    """Times from 0, s, (n,), position to acceleration, ENU, (n, 3, 3), and yaw, unwrapped, or along the path."""

    times_s: Array
    motion_enu: Array
    yaw_rad: Array | None
    note: str = ""  # what was derived, for the user


def read_samples(path: Path, text: str | None = None) -> SampledTrack:
    """Read columns t, x, y, z, vx, vy, vz, ax, ay, az (s, m, ENU), and yaw (degrees), or raise TrackFileError.

    Without accelerations, velocities and accelerations follow from smoothed positions.
    """
    table = read_table(path, _REQUIRED, _OPTIONAL, text, _ALIASES)
    times_s = table.times(_MIN_STEP_S)
    for columns in (_VELOCITY, _ACCELERATION):
        for column in columns:
            if column not in table.values and any(other in table.values for other in (*columns, *_ACCELERATION)):
                raise TrackFileError(f"{path}: line 1, column {column}: missing")
    unused = [*table.unused]
    known = [table.matrix(columns) for columns in (_PLACE, _VELOCITY, _ACCELERATION) if columns[0] in table.values]
    if len(known) == len(_PLACE):
        motion, steps_s = np.stack(known, axis=1), np.diff(times_s)[:, None]
        _check(table, steps_s, motion)
        note = _roughness(table, steps_s, motion)
    else:
        unused += [column for column in (*_VELOCITY, *_ACCELERATION) if column in table.values]
        count = max(_LEAST_SMOOTHED, round(_SMOOTHED_S / float(np.median(np.diff(times_s)))) | 1)
        smooth, *rates = local_fit(times_s, known[0], count)
        motion = np.stack([smooth, *rates], axis=1)
        off_m = np.abs(smooth - known[0]).max()
        note = f"{path}: smoothed, by at most {off_m:.2g} m; velocity and acceleration follow"
    said = f"{path}: columns not used: {', '.join(map(shown, unused))}" if unused else ""
    return SampledTrack(times_s, motion, table.yaw_rad, "; ".join(filter(None, (note, said))))


def local_fit(times_s: Array, values: Array, count: int) -> tuple[Array, Array, Array]:
    """Return the smoothed `values` (n, axes) and their first two derivatives.

    Each is of the least-squares polynomial of degree 4 through the nearest `count` samples.
    """
    n = len(times_s)
    count = min(count, n)
    size = min(_DEGREE, count - 1) + 1
    first = np.clip(np.arange(n) - count // 2, 0, n - count)
    scale_s = 0.5 * (times_s[first + count - 1] - times_s[first])
    moments, sums = np.zeros((2 * size - 1, n)), np.zeros((size, n, values.shape[1]))
    for offset in range(count):
        tau, power = (times_s[first + offset] - times_s) / scale_s, np.ones(n)
        for k in range(2 * size - 1):
            moments[k] += power
            if k < size:
                sums[k] += power[:, None] * values[first + offset]
            power = power * tau
    rows = [[moments[i + j].copy() for j in range(size)] for i in range(size)]
    for i in range(size):
        for below in range(i + 1, size):
            factor = rows[below][i] / rows[i][i]
            for j in range(i, size):
                rows[below][j] -= factor * rows[i][j]
            sums[below] -= factor[:, None] * sums[i]
    for i in reversed(range(size)):
        for j in range(i + 1, size):
            sums[i] -= rows[i][j][:, None] * sums[j]
        sums[i] /= rows[i][i][:, None]
    zero = np.zeros_like(values)
    curvature = 2.0 * sums[2] / (scale_s * scale_s)[:, None] if size > 2 else zero
    return sums[0], sums[1] / scale_s[:, None], curvature


def columns_of(times_s: Array, motion: Mapping[str, Array]) -> str:
    """Return the text of a file of samples; yaw in rad."""
    names = (*_REQUIRED, *_VELOCITY, *_ACCELERATION, *(("yaw",) if "yaw" in motion else ()))
    parts = [motion["position"], motion["velocity"], motion["acceleration"]]
    yaw = [np.degrees(motion["yaw"])] if "yaw" in motion else []
    rows = np.concatenate([times_s[:, None], *parts, *yaw], axis=1).tolist()
    return "\n".join([",".join(names), *(",".join(map(repr, row)) for row in rows)]) + "\n"


def _roughness(table: CsvTable, steps_s: Array, motion: Array) -> str:
    """Describe rounding: positions off by δ make accelerations of up to 5.8 δ / h² between rows h apart."""
    x, v, a = np.moveaxis(motion, 1, 0)
    off = np.diff(x, axis=0) - 0.5 * steps_s * (v[:-1] + v[1:]) + steps_s * steps_s / 12.0 * np.diff(a, axis=0)
    rough = _PEAK * np.abs(off).max(axis=1) / (steps_s * steps_s)[:, 0]
    row = int(np.argmax(rough))
    line = table.lines[row + 1]
    if rough[row] <= _ROUGH_M_S2 + 0.5 * np.abs(a).max():
        return ""
    return (
        f"{table.path}: rounding makes accelerations of up to {rough[row]:.2g} m/s² before line {line}: "
        "give more digits, or only positions, which are smoothed"
    )


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
