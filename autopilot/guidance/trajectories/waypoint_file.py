"""Waypoints from a file: where to be, when, and which way to look; read strictly from CSV."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np

from colibri.autopilot.errors import AutopilotError
from colibri.common.types import Array

DEFAULT_SPEED_M_S = 2.0
MIN_LEG_S = 0.05
MAX_DURATION_S = 3600.0

_REQUIRED = ("x", "y", "z")
_COLUMNS = (*_REQUIRED, "t", "yaw")
_MAX_DISTANCE_M = 1e4
"""Of every number in the file, in its unit."""


class WaypointsError(AutopilotError):
    """Waypoints that cannot be flown; the message names file, line and column."""


@dataclass(frozen=True, slots=True)
class Waypoints:
    """Where to be and when.

    Attributes:
        times_s: Strictly increasing from 0, s, (n,), n >= 2.
        points_enu_m: (n, 3), m, ENU.
        yaw_rad: Unwrapped the shorter way round, (n,), rad; None to look along the path.
    """

    times_s: Array
    points_enu_m: Array
    yaw_rad: Array | None


@dataclass(frozen=True, slots=True)
class _Table:
    """The numbers of a file: their columns, and the line that each row stands on."""

    path: Path
    values: dict[str, Array]
    lines: list[int]

    def error(self, row: int, column: str, what: str) -> WaypointsError:
        return WaypointsError(f"{self.path}: line {self.lines[row]}, column {column}: {what}")


def read_waypoints(path: Path, speed_m_s: float | None) -> Waypoints:
    """Read a CSV file with a header of x, y, z (m, ENU), and if wanted t (s) and yaw (degrees).

    Without `t`, the legs are flown at `speed_m_s` on average, 2 m/s if it is None; the first and the last, which begin
    and end at rest, at half of it.

    Raises:
        WaypointsError: The file cannot be read, or not be flown.
    """
    table = _read(path)
    points = np.stack([table.values[column] for column in _REQUIRED], axis=1)
    if "t" in table.values and speed_m_s is not None:
        raise WaypointsError(f"{path}: line 1, column t: says when to be where, so leave speed out")
    times_s = _given_times(table) if "t" in table.values else _times(table, points, speed_m_s or DEFAULT_SPEED_M_S)
    yaw = table.values.get("yaw")
    return Waypoints(times_s, points, None if yaw is None else np.unwrap(np.radians(yaw)))


def _given_times(table: _Table) -> Array:
    times_s = table.values["t"]
    if times_s[0] != 0.0:
        raise table.error(0, "t", f"the first time must be 0, not {times_s[0]:g}")
    for row in np.flatnonzero(np.diff(times_s) < MIN_LEG_S)[:1] + 1:
        raise table.error(row, "t", f"must be at least {MIN_LEG_S:g} s after the line before")
    return _checked(table, "t", times_s)


def _times(table: _Table, points: Array, speed_m_s: float) -> Array:
    steps = np.diff(points, axis=0)
    legs_s = np.sqrt((steps * steps).sum(axis=1)) / speed_m_s
    for row in np.flatnonzero(legs_s < MIN_LEG_S)[:1] + 1:
        raise table.error(row, "x", f"less than {MIN_LEG_S:g} s from the line before at {speed_m_s:g} m/s")
    legs_s[[0, -1]] *= 2.0
    return _checked(table, "x", np.concatenate([[0.0], np.cumsum(legs_s)]))


def _checked(table: _Table, column: str, times_s: Array) -> Array:
    for row in np.flatnonzero(times_s > MAX_DURATION_S)[:1]:
        raise table.error(row, column, f"reached after {times_s[row]:g} s, and {MAX_DURATION_S:g} s is the longest")
    return times_s


def _read(path: Path) -> _Table:
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except OSError as reason:
        raise WaypointsError(f"{path}: {reason.strerror}") from reason
    except ValueError as reason:
        raise WaypointsError(f"{path}: {reason}") from reason
    header = _header(path, lines[0].split(",") if lines else [])
    rows = list(_rows(path, lines[1:], header))
    if len(rows) < 2:
        raise WaypointsError(f"{path}: line {len(lines)}: the file ends, and a track needs two waypoints")
    columns = np.array([values for _, values in rows]).T
    return _Table(path, dict(zip(header, columns, strict=True)), [line for line, _ in rows])


def _header(path: Path, cells: list[str]) -> list[str]:
    header = [cell.strip() for cell in cells]
    for column in header:
        if column not in _COLUMNS or header.count(column) > 1:
            what = "twice" if column in _COLUMNS else "unknown"
            raise WaypointsError(f"{path}: line 1, column {column}: {what}: choose {', '.join(_COLUMNS)}")
    for column in _REQUIRED:
        if column not in header:
            raise WaypointsError(f"{path}: line 1, column {column}: missing")
    return header


def _rows(path: Path, lines: list[str], header: list[str]) -> Iterator[tuple[int, list[float]]]:
    """Yield line number and numbers of each row that is not blank."""
    for line, text in enumerate(lines, start=2):
        cells = text.split(",")
        if not text.strip():
            continue
        for column, cell in zip(header, cells, strict=False):
            if not _is_sane(cell):
                limits = f"a number from {-_MAX_DISTANCE_M:g} to {_MAX_DISTANCE_M:g}"
                raise WaypointsError(f"{path}: line {line}, column {column}: expected {limits}, not {cell!r}")
        if len(cells) != len(header):
            column = header[len(cells)] if len(cells) < len(header) else str(len(header) + 1)
            what = "missing" if len(cells) < len(header) else "has no name in the header"
            raise WaypointsError(f"{path}: line {line}, column {column}: {what}")
        yield line, [float(cell) for cell in cells]


def _is_sane(cell: str) -> bool:
    try:
        number = float(cell)
    except ValueError:
        return False
    return isfinite(number) and abs(number) <= _MAX_DISTANCE_M
