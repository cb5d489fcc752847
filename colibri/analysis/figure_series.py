"""Series of a flight's figures, reduced to the points that can be shown."""

from collections.abc import Iterable
from typing import TypeAlias

import numpy as np

from colibri.analysis.recording import (
    ATTITUDE_REFERENCE,
    COLUMNS,
    POSITION_REFERENCE,
    SETTLED_AFTER_S,
    Samples,
    columns_of,
)
from colibri.common.compiled_rotations import quaternion_from_euler, rotation_matrix
from colibri.common.jit import compiled
from colibri.common.types import Array
from colibri.flights.plan import FlightPlan

_AT_ONCE = 1024


class Extremes:
    """Rows over time; beyond `most`, a multiple of 4, the two extremes of each column in spans below a pixel."""

    def __init__(self, columns: int, most: int) -> None:
        self._points: Array = np.empty((most, columns))
        self._count = 0
        self._span = 2
        self._rest: Array = np.empty((0, columns))

    def add(self, rows: Array) -> None:
        self._rest = np.concatenate([self._rest, rows])
        while len(self._rest) >= self._span:
            if self._count == len(self._points):
                self._halve()
                continue
            spans = min(len(self._rest) // self._span, (len(self._points) - self._count) // 2)
            taken, self._rest = np.split(self._rest, [spans * self._span])
            self._points[self._count : self._count + 2 * spans] = _extremes(taken, self._span)
            self._count += 2 * spans

    def points(self) -> list[Array]:
        """Return all rows, or two a span, in parts of (k, columns)."""
        rest = _extremes(self._rest, len(self._rest)) if len(self._rest) > 1 else self._rest
        return [self._points[: self._count], rest]

    def _halve(self) -> None:
        for first in range(0, self._count, _AT_ONCE):
            points = self._points[first : first + _AT_ONCE]
            self._points[first // 2 : (first + len(points)) // 2] = _extremes(points, 4)
        self._count //= 2
        self._span *= 2


class EveryNth:
    """Rows; beyond `most` every second, fourth or eighth, and the last."""

    def __init__(self, columns: int, most: int) -> None:
        self._most = most
        self._kept: list[Array] = []
        self._count = self._seen = 0
        self._step = 1
        self._last: Array = np.empty((0, columns))

    def add(self, rows: Array) -> None:
        self._last = rows[-1:].copy()
        self._kept.append(rows[-self._seen % self._step :: self._step].copy())
        self._count += len(self._kept[-1])
        self._seen += len(rows)
        while self._count > self._most:
            self._kept = [np.concatenate(self._kept)[::2].copy()]
            self._count = len(self._kept[0])
            self._step *= 2

    def points(self) -> list[Array]:
        """Return parts of (k, columns)."""
        is_kept = (self._seen - 1) % self._step == 0
        return [*self._kept, self._last[: 0 if is_kept else 1]]


def _extremes(rows: Array, span: int) -> Array:
    """Return the extremes of each `span` of n rows, by columns, in order, (2 n / span, columns)."""
    spans = rows.reshape(-1, span, rows.shape[1])
    places = np.sort(np.stack([spans.argmin(axis=1), spans.argmax(axis=1)], axis=1), axis=1)
    return np.take_along_axis(spans, places, axis=1).reshape(-1, rows.shape[1])


Series: TypeAlias = dict[str, Array]
"""Name -> values, (n,); `t` holds their times, s."""

POSITION = ("x", "y", "z")
VELOCITY = ("vx", "vy", "vz")
ATTITUDE = ("phi", "theta", "psi")
START_S = 10.0  # enlarged start, kept complete
MAX_POINTS = 1 << 14  # points after the start: several for each pixel
MAX_PATH_POINTS = 1 << 16  # points of a path: for an hour, chords are off by less than a pixel

_SLOPES = tuple(f"{name}_ref" for name in VELOCITY)
_ERRORS = tuple(f"e{axis}" for axis in POSITION)
_NAMES = (*COLUMNS, *VELOCITY, *_ERRORS, "distance", *_SLOPES)
_T = _NAMES.index("t")
_ANGLES = [_NAMES.index(name) for name in (*ATTITUDE, *ATTITUDE_REFERENCE)]
_REFERENCES = [_NAMES.index(name) for name in POSITION_REFERENCE]
_OF_REFERENCES = [_NAMES.index(name) for name in _SLOPES]


class FigureSeries:
    """Collects a flight for its figures part by part."""

    def __init__(self, plan: FlightPlan, parts: Iterable[Samples] = ()) -> None:
        self._rotors = plan.plant_vehicle.rotors
        self._names = _NAMES + columns_of(plan)[len(COLUMNS) :]
        self._start: list[Array] = []
        self._later = Extremes(len(self._names), MAX_POINTS)
        self._path = EveryNth(len(POSITION) + len(POSITION_REFERENCE), MAX_PATH_POINTS)
        self._newest: Array = np.empty((0, len(self._names)))
        self._squares_m2 = 0.0
        self._settled = 0
        for part in parts:
            self.add(part)

    def add(self, part: Samples) -> None:
        self._path.add(part.columns((*POSITION, *POSITION_REFERENCE)))
        settled = part.position_error_m[part["t"] >= SETTLED_AFTER_S]
        self._squares_m2 += float(np.sum(settled**2))
        self._settled += len(settled)
        # The slope at the newest sample needs the next one, and the one before.
        known = len(self._newest)
        rows = np.concatenate([self._newest, _rows(part)])
        if len(rows) > 1:
            rows[:, _OF_REFERENCES] = np.gradient(rows[:, _REFERENCES], rows[:, _T], axis=0)
        self._keep(rows[max(known - 1, 0) : -1])
        self._newest = rows[-2:].copy()

    def over_time(self) -> Series:
        """Return columns, angles in degrees, velocities, ENU, errors, their norm `distance`, its RMS once settled."""
        series = _columns(self._names, [*self._start, *self._later.points(), self._newest[-1:]])
        t = series["t"]
        rms = np.sqrt(self._squares_m2 / self._settled) if t[-1] > SETTLED_AFTER_S else np.nan
        return series | {
            "rms": np.where(t >= SETTLED_AFTER_S, rms, np.nan),
            "idle": np.full_like(t, self._rotors.idle_speed),
            "fastest": np.full_like(t, self._rotors.max_speed),
        }

    def in_space(self) -> Series:
        """Return position and reference without times."""
        return _columns((*POSITION, *POSITION_REFERENCE), self._path.points())

    def _keep(self, rows: Array) -> None:
        later = rows[:, _T] > START_S
        self._start.append(rows[~later])
        self._later.add(rows[later])


def _columns(names: tuple[str, ...], parts: list[Array]) -> Series:
    return {name: np.concatenate([part[:, column] for part in parts]) for column, name in enumerate(names)}


def _rows(part: Samples) -> Array:
    """Return a part's series as in `_NAMES`, then more rotors; the slopes are nan."""
    position, reference = part.columns(POSITION), part.columns(POSITION_REFERENCE)
    columns = [
        part.table[:, : len(COLUMNS)],
        _earth_velocity(part.columns(ATTITUDE), part.columns(("u", "v", "w"))),
        position - reference,
        part.position_error_m[:, None],
        np.full_like(reference, np.nan),
        part.table[:, len(COLUMNS) :],
    ]
    rows = np.hstack(columns)
    rows[:, _ANGLES] = np.degrees(rows[:, _ANGLES])
    return rows


@compiled
def _earth_velocity(attitudes: Array, velocities: Array) -> Array:
    """Turn velocities FLU (n, 3) to ENU by Euler angles (n, 3)."""
    turned = np.empty_like(velocities)
    for i in range(len(turned)):
        R = rotation_matrix(quaternion_from_euler(attitudes[i, 0], attitudes[i, 1], attitudes[i, 2]))
        u, v, w = velocities[i, 0], velocities[i, 1], velocities[i, 2]
        for k in range(3):
            turned[i, k] = R[k][0] * u + R[k][1] * v + R[k][2] * w
    return turned
