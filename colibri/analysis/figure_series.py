"""Series of a flight's figures, reduced to the points that can be shown."""

from collections.abc import Iterable
from math import ceil
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
from colibri.common.types import Array
from colibri.flights.plan import FlightPlan


class Extremes:
    """Rows over time; beyond `most` of at most so many, the two extremes of each column in spans below a pixel."""

    def __init__(self, columns: int, rows: int, most: int) -> None:
        self._span = 2 * max(ceil(rows / most), 1)  # without rows, too
        self._points: Array = np.empty((2 * ceil(rows / self._span), columns))
        self._count = 0
        self._rest: Array = np.empty((0, columns))

    def add(self, rows: Array) -> None:
        rows = np.concatenate([self._rest, rows])
        whole = len(rows) // self._span * self._span
        count = self._count + 2 * whole // self._span
        self._points[self._count : count] = _extremes(rows[:whole], self._span)
        self._count, self._rest = count, rows[whole:]

    def points(self) -> list[Array]:
        """Return parts of (k, columns)."""
        rest = _extremes(self._rest, len(self._rest)) if len(self._rest) > 1 else self._rest
        return [self._points[: self._count], rest]


class EveryNth:
    """Rows; beyond `most` of at most so many, every second, third and so on, and the last."""

    def __init__(self, columns: int, rows: int, most: int) -> None:
        self._step, self._seen = max(ceil(rows / most), 1), 0
        self._points: Array = np.empty((rows // self._step + 2, columns))
        self._count = 0

    def add(self, rows: Array) -> None:
        kept = rows[-self._seen % self._step :: self._step]
        self._seen += len(rows)
        self._points[self._count : self._count + len(kept)] = kept
        self._count += len(kept)
        self._points[self._count] = rows[-1]

    def points(self) -> list[Array]:
        """Return parts of (k, columns)."""
        is_kept = (self._seen - 1) % self._step == 0
        return [self._points[: self._count + (0 if is_kept else 1)]]


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
MAX_POINTS = 1 << 15  # points after the start: several for each pixel
MAX_PATH_POINTS = 1 << 17  # points of a path: for an hour, chords are off by less than a pixel

_SLOPES = tuple(f"{name}_ref" for name in VELOCITY)
_ERRORS = tuple(f"e{axis}" for axis in POSITION)
_NAMES = (*COLUMNS, *VELOCITY, *_ERRORS, "distance", *_SLOPES)
_T = _NAMES.index("t")
_ANGLES = [_NAMES.index(name) for name in (*ATTITUDE, *ATTITUDE_REFERENCE)]
_REFERENCES = [_NAMES.index(name) for name in POSITION_REFERENCE]
_OF_REFERENCES = [_NAMES.index(name) for name in _SLOPES]


class FigureSeries:
    """Collects a flight, of at most so many samples, for its figures part by part."""

    def __init__(self, plan: FlightPlan, samples: int, parts: Iterable[Samples] = ()) -> None:
        self._rotors = plan.plant_vehicle.rotors
        self._names = _NAMES + columns_of(plan)[len(COLUMNS) :]
        self._start: list[Array] = []
        self._later = Extremes(len(self._names), samples, MAX_POINTS)
        self._path = EveryNth(len(POSITION) + len(POSITION_REFERENCE), samples, MAX_PATH_POINTS)
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
        rows, self._newest = rows[max(known - 1, 0) : -1], rows[-2:].copy()
        later = rows[:, _T] > START_S
        self._start.append(rows[~later])
        self._later.add(rows[later])

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


def _earth_velocity(attitudes: Array, velocities: Array) -> Array:
    """Turn velocities FLU (n, 3) to ENU by Euler angles (n, 3)."""
    (u, v, w), (phi, theta, psi) = velocities.T, attitudes.T
    y, z = v * np.cos(phi) - w * np.sin(phi), v * np.sin(phi) + w * np.cos(phi)
    x, z = u * np.cos(theta) + z * np.sin(theta), z * np.cos(theta) - u * np.sin(theta)
    return np.stack([x * np.cos(psi) - y * np.sin(psi), x * np.sin(psi) + y * np.cos(psi), z], axis=1)
