"""Strict CSV tables; errors name file, line and column."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np

from colibri.autopilot.errors import AutopilotError
from colibri.common.errors import shown
from colibri.common.files import read_given
from colibri.common.types import Array

MAX_DURATION_S = 3600.0

_MAX_NUMBER = 1e4  # limit of every number, in its unit
_ROUNDING_S = 1e-6


class TrackFileError(AutopilotError):
    """A file that cannot be flown; the message names the place."""


@dataclass(frozen=True, slots=True)
class CsvTable:
    """Columns, (n,) each, n >= 2, their lines, and the names of columns that are left out."""

    path: Path
    values: dict[str, Array]
    lines: list[int]
    unused: tuple[str, ...] = ()

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


def read_table(
    path: Path,
    required: Collection[str],
    optional: Collection[str],
    text: str | None = None,
    aliases: Mapping[str, tuple[str, float]] | None = None,
) -> CsvTable:
    """Read a CSV file, or its `text`; TrackFileError if malformed.

    `aliases` are other names, in lower case, with the column and the factor to its unit. With them the case of names is
    ignored, and unknown columns are left out.
    """
    lines = (read_given(path, TrackFileError) if text is None else text).splitlines()
    known, cells = (*required, *optional), [cell.strip() for cell in lines[0].split(",")] if lines else []
    found = [(cell, 1.0) if aliases is None else aliases.get(cell.lower(), (cell.lower(), 1.0)) for cell in cells]
    header = [name for name, _ in found]
    _check_header(path, cells, header, required, known, spare=aliases is not None)
    rows = list(_rows(path, lines[1:], header, known))
    if len(rows) < 2:
        raise TrackFileError(f"{path}: line {len(lines)}: the file ends, and a track needs two rows")
    columns = np.array([values for _, values in rows]).T
    used = [(name, factor) for name, factor in found if name in known]
    values = {name: factor * column for (name, factor), column in zip(used, columns, strict=True)}
    unused = tuple(cell for cell, name in zip(cells, header, strict=True) if name not in known)
    return CsvTable(path, values, [line for line, _ in rows], unused)


def _check_header(
    path: Path, cells: list[str], header: list[str], required: Collection[str], known: Collection[str], *, spare: bool
) -> None:
    for cell, column in zip(cells, header, strict=True):
        if column in known and header.count(column) > 1:
            also = "" if cell == column else f" as {column}"
            raise TrackFileError(f"{path}: line 1, column {shown(cell)}: twice{also}: choose {', '.join(known)}")
        if column not in known and not spare:
            raise TrackFileError(f"{path}: line 1, column {shown(cell)}: unknown: choose {', '.join(known)}")
    for column in required:
        if column not in header:
            raise TrackFileError(f"{path}: line 1, column {column}: missing")


def _rows(path: Path, lines: list[str], header: list[str], known: Collection[str]) -> Iterator[tuple[int, list[float]]]:
    for line, text in enumerate(lines, start=2):
        cells = text.split(",")
        if not text.strip():
            continue
        used = [(column, cell) for column, cell in zip(header, cells, strict=False) if column in known]
        for column, cell in used:
            if not _is_sane(cell):
                limits = f"a number from {-_MAX_NUMBER:g} to {_MAX_NUMBER:g}"
                raise TrackFileError(f"{path}: line {line}, column {column}: expected {limits}, not '{shown(cell)}'")
        if len(cells) != len(header):
            column = header[len(cells)] if len(cells) < len(header) else str(len(header) + 1)
            what = "missing" if len(cells) < len(header) else "is not named in the header"
            raise TrackFileError(f"{path}: line {line}, column {column}: {what}")
        yield line, [float(cell) for _, cell in used]


def _is_sane(cell: str) -> bool:
    try:
        number = float(cell)
    except ValueError:
        return False
    return isfinite(number) and abs(number) <= _MAX_NUMBER
