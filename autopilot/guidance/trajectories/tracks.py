"""The tracks: position and yaw as formulas of time."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf, pi, radians
from pathlib import Path
from typing import Annotated, ClassVar, Literal, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from colibri.autopilot.guidance.trajectories.ramped import SHAPES, Curve, arc, duration_s
from colibri.autopilot.guidance.trajectories.samples_file import SampledTrack, read_samples
from colibri.autopilot.guidance.trajectories.taylor import TaylorSeries, atan2, cos, held, in_series, sin
from colibri.autopilot.guidance.trajectories.waypoint_file import Waypoints, read_waypoints
from colibri.common.config import Table
from colibri.common.types import Array

Place: TypeAlias = tuple[TaylorSeries, TaylorSeries, TaylorSeries]  # x, y, z in m, ENU
Length: TypeAlias = Annotated[float, msgspec.Meta(ge=0.01, le=1000.0)]
Coordinate: TypeAlias = Annotated[float, msgspec.Meta(ge=-1000.0, le=1000.0)]
Speed: TypeAlias = Annotated[float, msgspec.Meta(ge=0.01, le=100.0)]
Lap: TypeAlias = Annotated[float, msgspec.Meta(ge=0.1, le=3600.0)]
Angle: TypeAlias = Annotated[float, msgspec.Meta(ge=-360.0, le=360.0)]
YawChoice: TypeAlias = Literal["path", "fixed"]

DURATION_S = 100.0

_RADIUS_M, _TURNS_PER_S, _CLIMB_M_S, _START_HEIGHT_M = 2.0, 0.025, 0.03, 2.0
_INSTANT_S = 1e-9  # tolerance of rounding: times are whole microseconds


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """Position and yaw as formulas of time; equal to itself alone, as formulas are not compared.

    Attributes:
        position: Time in s -> x, y, z in m, ENU.
        yaw: Time in s -> yaw in rad, counter-clockwise from east, unwrapped; by default along the horizontal velocity.
            An endless track requires it, so that yaw depends on time alone.
        duration_s: Then the track rests at its last point; infinite for an endless track.
        waypoints: Waypoints, if the track between them may be changed.
        note: Quantities derived from samples, for the user.
    """

    position: Callable[[TaylorSeries], Place]
    yaw: Callable[[TaylorSeries], TaylorSeries] | None = None
    duration_s: float = DURATION_S
    waypoints: Waypoints | None = None
    note: str = ""

    def __post_init__(self) -> None:
        if self.yaw is None and self.duration_s == inf:
            raise ValueError("a track without end needs a formula for its yaw")

    def clock(self, t: Array, order: int) -> TaylorSeries:
        """Return path time at `t` (n,), s, which stops at the end of the track."""
        ended = self.ended(t)
        time = TaylorSeries.time(np.where(ended, self.duration_s, t), order)
        time.coefficients[1:2, ended] = 0.0
        return time

    def ended(self, t: Array) -> NDArray[np.bool_]:
        """Return whether the track has ended, at each of `t` (n,), s."""
        ended: NDArray[np.bool_] = t > self.duration_s + _INSTANT_S
        return ended


def spiral(t: TaylorSeries) -> Place:
    alpha = _alpha(t)
    return _RADIUS_M * cos(alpha), _RADIUS_M * sin(alpha), _climb(t)


def expanding_spiral(t: TaylorSeries) -> Place:
    alpha, radius = _alpha(t), _RADIUS_M * 0.1 * t + _RADIUS_M
    return radius * cos(alpha), radius * sin(alpha), _climb(t)


def line(t: TaylorSeries) -> Place:
    return 0.1 * t + 1.0, 0.1 * t - 2.0, _climb(t)


def wave(t: TaylorSeries) -> Place:
    return _RADIUS_M * cos(_alpha(t)), 2.0 * t, _climb(t)


def crown(t: TaylorSeries) -> Place:
    alpha = _alpha(t)
    return _RADIUS_M * cos(alpha), _RADIUS_M * sin(alpha), 1.5 * sin(t) + _START_HEIGHT_M


THESIS_TRACKS: dict[str, Track] = {
    "spiral": Track(spiral),
    "expanding-spiral": Track(expanding_spiral),
    "line": Track(line),
    "wave": Track(wave),
    "crown": Track(crown),
}


class TrackOptions(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Options of a track, each a field with range and default; lengths in m, times in s, angles in degrees.

    Attributes:
        lone: Option that a value without a key sets.
    """

    lone: ClassVar[str | None] = None

    def track(self) -> Track:
        """Return the track with these options; TrackFileError if its file cannot be flown."""
        raise NotImplementedError


class Hover(TrackOptions, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Stay at one point."""

    x: Coordinate = 0.0
    y: Coordinate = 0.0
    height: Coordinate = 2.0
    yaw: Angle = 0.0

    def track(self) -> Track:
        place = in_series(lambda _: (self.x, self.y, self.height))
        return Track(place, in_series(lambda _: radians(self.yaw)), inf)


class Lemniscate(TrackOptions, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Gerono's lemniscate: x = size sin ωt, y = size sin ωt cos ωt."""

    size: Length = 4.0
    height: Coordinate = 3.0
    lap: Lap = 6.0
    yaw: YawChoice = "path"

    def track(self) -> Track:
        return Track(self._position, _east if self.yaw == "fixed" else self._along, inf)

    def _position(self, t: TaylorSeries) -> Place:
        alpha = 2.0 * pi / self.lap * t
        x = self.size * sin(alpha)
        return x, x * cos(alpha), held(t, self.height)

    def _along(self, t: TaylorSeries) -> TaylorSeries:
        """Return yaw along (cos α, cos 2α): relative to -90° it stays within ±180°, so it never wraps."""
        alpha = 2.0 * pi / self.lap * t
        return atan2(cos(alpha), -1.0 * cos(2.0 * alpha)) - 0.5 * pi


class Circle(TrackOptions, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Circle around the origin, counter-clockwise from the east."""

    radius: Length = 2.0
    speed: Speed = 2.0
    height: Coordinate = 2.0
    yaw: YawChoice = "path"

    def track(self) -> Track:
        return Track(self._position, _east if self.yaw == "fixed" else self._along, inf)

    def _position(self, t: TaylorSeries) -> Place:
        alpha = self.speed / self.radius * t
        return self.radius * cos(alpha), self.radius * sin(alpha), held(t, self.height)

    def _along(self, t: TaylorSeries) -> TaylorSeries:
        return self.speed / self.radius * t + 0.5 * pi


class Ramped(TrackOptions, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Follow a closed curve at a speed that grows from rest and falls back; the vehicle looks along `heading`."""

    curve: Curve = "circle"
    speed: Speed = 5.0
    acceleration: Annotated[float, msgspec.Meta(ge=0.01, le=10.0)] = 0.25
    radius: Length | None = None
    turn: Literal["left", "right"] = "left"
    heading: Angle = 0.0

    def __post_init__(self) -> None:
        if self.speed < 2.0 * self.acceleration:
            raise ValueError(
                f"speed={self.speed:g}: must be at least {2.0 * self.acceleration:g}, acceleration times 2 s"
            )

    def track(self) -> Track:
        return Track(
            self._position, lambda t: held(t, radians(self.heading)), duration_s(self.speed, self.acceleration)
        )

    def _position(self, t: TaylorSeries) -> Place:
        shape, heading = SHAPES[self.curve], held(t, radians(self.heading))
        radius = self.radius or shape.radius_m
        angle = (1.0 if self.turn == "right" else -1.0) / radius * arc(t, self.speed, self.acceleration)
        x, y = (radius * each for each in shape.across(angle))
        east, north = cos(heading), sin(heading)
        return x * east - y * north, x * north + y * east, shape.height(angle)


class FileOptions(TrackOptions, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Options of a track from a file."""

    lone: ClassVar[str | None] = "file"

    file: str

    def track(self) -> Track:
        return self.track_of(None)

    def track_of(self, text: str | None) -> Track:
        """Return the track; `text` replaces the file."""
        raise NotImplementedError


class WaypointFile(FileOptions, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Fly through points with minimum snap, or as fast as possible."""

    speed: Speed | Literal["max"] | None = None
    margin: Annotated[float, msgspec.Meta(ge=0.0, le=0.4)] | None = None
    tolerance: Annotated[float, msgspec.Meta(gt=0.0, le=100.0)] | None = None

    def track_of(self, text: str | None) -> Track:
        return through(read_waypoints(Path(self.file), self.speed, self.margin, text, self.tolerance))


class SamplesFile(FileOptions, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Fly samples unchanged."""

    def track_of(self, text: str | None) -> Track:
        return sampled(read_samples(Path(self.file), text))


OPTIONS: dict[str, type[TrackOptions]] = {
    "hover": Hover,
    "lemniscate": Lemniscate,
    "circle": Circle,
    "ramped": Ramped,
    "waypoints": WaypointFile,
    "samples": SamplesFile,
}


def through(waypoints: Waypoints, heights: Array | None = None, between: Array | None = None) -> Track:
    """Return the minimum-snap track, also passing `heights` (t, z), (n, 2), and `between` (t, x, y, z), (n, 4)."""
    from colibri.autopilot.guidance.trajectories.minimum_snap import SNAP, minimise  # slow to load: most do without

    times_s = waypoints.times_s
    given = np.concatenate([times_s[:, None], waypoints.points_enu_m], axis=1)
    passed = _in_time(given, between)
    places = minimise(SNAP, passed[:, 0], passed[:, 1:])
    height = None
    if heights is not None:
        passed = _in_time(given[:, [0, 3]], heights)
        height = minimise(SNAP, passed[:, 0], passed[:, 1:])

    def position(t: TaylorSeries) -> Place:
        x, y, z = places(t)
        return x, y, z if height is None else height(t)[0]

    return _looking(position, times_s, waypoints.yaw_rad, waypoints)


def sampled(samples: SampledTrack) -> Track:
    """Return the track by quintic interpolation, with continuous acceleration."""
    from colibri.autopilot.guidance.trajectories.minimum_snap import interpolate

    places = interpolate(samples.times_s, samples.motion_enu)

    def position(t: TaylorSeries) -> Place:
        x, y, z = places(t)
        return x, y, z

    return replace(_looking(position, samples.times_s, samples.yaw_rad), note=samples.note)


def _looking(
    position: Callable[[TaylorSeries], Place], times_s: Array, yaw_rad: Array | None, waypoints: Waypoints | None = None
) -> Track:
    from colibri.autopilot.guidance.trajectories.minimum_snap import ACCELERATION, minimise

    duration_s = float(times_s[-1])
    if yaw_rad is None:
        return Track(position, None, duration_s, waypoints)
    looks = minimise(ACCELERATION, times_s, yaw_rad[:, None])
    return Track(position, lambda t: looks(t)[0], duration_s, waypoints)


def _in_time(rows: Array, others: Array | None) -> Array:
    both = rows if others is None else np.concatenate([rows, others])
    return both[np.argsort(both[:, 0], kind="stable")]


def position(track: Track, t: Array, derivative: int = 0) -> Array:
    """Return a derivative of the position, ENU, (n, 3), at rest after the end."""
    time = track.clock(np.asarray(t, dtype=np.float64), derivative)
    return np.stack([axis.derivative(derivative) for axis in track.position(time)], axis=-1)


def _alpha(t: TaylorSeries) -> TaylorSeries:
    return 2.0 * np.pi * _TURNS_PER_S * t


def _climb(t: TaylorSeries) -> TaylorSeries:
    return _CLIMB_M_S * t + _START_HEIGHT_M


def _east(t: TaylorSeries) -> TaylorSeries:
    return held(t, 0.0)
