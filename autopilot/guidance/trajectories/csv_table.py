"""Strict CSV tables; errors name file, line and column."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np

from colibri.autopilot.errors import AutopilotError
from colibri.common.errors import shown
from colibri.common.files import read_text
from colibri.common.types import Array

MAX_DURATION_S = 3600.0

_MAX_NUMBER = 1e4
"""Limit of every number, in its unit."""
_ROUNDING_S = 1e-6


class TrackFileError(AutopilotError):
    """A file that cannot be flown; the message names the place."""


@dataclass(frozen=True, slots=True)
class CsvTable:
    """Columns, (n,) each, n >= 2, and their lines."""

    path: Path
    values: dict[str, Array]
    lines: list[int]

    def error(self, row: int, column: str, what: str) -> TrackFileError:
        return TrackFileError(f"{self.path}: line {self.lines[row]}, column {column}: {what}")

    def matrix(self, columns: Sequence[str]) -> Array:
        return np.stack([self.values[column] for column in columns], axis=1)

    @property
    def yaw_rad(self) -> Array | None:
        """Column yaw, unwrapped, (n,)."""
        yaw = self.values.get("yaw")
        return None if yaw is None else np.unwrap(np.radians(yaw))

    def times(self, min_step_s: float) -> Array:
        """Return column t, s, which must start at 0 and increase by at least `min_step_s`."""
        times_s = self.values["t"]
        if times_s[0] != 0.0:
            raise self.error(0, "t", f"the first time must be 0, not {times_s[0]:g}")
        for row in np.flatnonzero(np.diff(times_s) < min_step_s - _ROUNDING_S)[:1] + 1:
            raise self.error(row, "t", f"must be at least {min_step_s:g} s after the line before")
        self.check_duration("t", times_s)
        return times_s

    def check_duration(self, column: str, times_s: Array) -> None:
        """Raise a TrackFileError for `column` if a row is reached too late."""
        for row in np.flatnonzero(times_s > MAX_DURATION_S)[:1]:
            raise self.error(row, column, f"reached after {times_s[row]:g} s, and {MAX_DURATION_S:g} s is the longest")


def read_table(path: Path, required: Collection[str], optional: Collection[str], text: str | None = None) -> CsvTable:
    """Read a CSV file, or its `text`; TrackFileError if malformed."""
    try:
        lines = (read_text(path, "utf-8-sig") if text is None else text).splitlines()
    except OSError as reason:
        raise TrackFileError(f"{path}: {reason.strerror}") from reason
    except ValueError as reason:
        raise TrackFileError(f"{path}: {reason}") from reason
    header = _header(path, lines[0].split(",") if lines else [], required, (*required, *optional))
    rows = list(_rows(path, lines[1:], header))
    if len(rows) < 2:
        raise TrackFileError(f"{path}: line {len(lines)}: the file ends, and a track needs two rows")
    columns = np.array([values for _, values in rows]).T
    return CsvTable(path, dict(zip(header, columns, strict=True)), [line for line, _ in rows])


def _header(path: Path, cells: list[str], required: Collection[str], known: Collection[str]) -> list[str]:
    header = [cell.strip() for cell in cells]
    for column in header:
        if column not in known or header.count(column) > 1:
            what = "twice" if column in known else "unknown"
            raise TrackFileError(f"{path}: line 1, column {shown(column)}: {what}: choose {', '.join(known)}")
    for column in required:
        if column not in header:
            raise TrackFileError(f"{path}: line 1, column {column}: missing")
    return header


def _rows(path: Path, lines: list[str], header: list[str]) -> Iterator[tuple[int, list[float]]]:
    for line, text in enumerate(lines, start=2):
        cells = text.split(",")
        if not text.strip():
            continue
        for column, cell in zip(header, cells, strict=False):
            if not _is_sane(cell):
                limits = f"a number from {-_MAX_NUMBER:g} to {_MAX_NUMBER:g}"
                raise TrackFileError(f"{path}: line {line}, column {column}: expected {limits}, not '{shown(cell)}'")
        if len(cells) != len(header):
            column = header[len(cells)] if len(cells) < len(header) else str(len(header) + 1)
            what = "missing" if len(cells) < len(header) else "is not named in the header"
            raise TrackFileError(f"{path}: line {line}, column {column}: {what}")
        yield line, [float(cell) for cell in cells]


def _is_sane(cell: str) -> bool:
    try:
        number = float(cell)
    except ValueError:
        return False
    return isfinite(number) and abs(number) <= _MAX_NUMBER
