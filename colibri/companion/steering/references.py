"""Tracks as a companion flies them, and recent references.

A track's time starts smoothly, as a standing vehicle cannot follow a track that begins at speed: its rate rises from 0
to 1 by a polynomial whose first four derivatives vanish at both ends. What the track hover leaves out is the vehicle's
own. The error of an estimate that arrives late needs the reference of that time.
"""

from bisect import bisect_right
from dataclasses import replace
from math import degrees
from typing import NamedTuple

import numpy as np

from colibri.autopilot.guidance.trajectories.taylor import TaylorSeries
from colibri.autopilot.guidance.trajectories.tracks import Hover, Place, Track
from colibri.common.types import Vector

OVER_S = 4.0
_SLOPE = (126.0, -420.0, 540.0, -315.0, 70.0)
"""Coefficients of u^5 to u^9: rises from 0 to 1 over u = 0..1."""
_FIRST_POWER = 5


def smoothly_started(track: Track, over_s: float = OVER_S) -> Track:
    look = track.yaw

    def position(t: TaylorSeries) -> Place:
        return track.position(_warped(t, over_s))

    def yaw(t: TaylorSeries) -> TaylorSeries:
        assert look is not None, "used only where there is a formula"
        return look(_warped(t, over_s))

    return replace(
        track,
        position=position,
        yaw=None if look is None else yaw,
        duration_s=track.duration_s + 0.5 * over_s,
    )


def _warped(t: TaylorSeries, over_s: float) -> TaylorSeries:
    u = t / over_s
    power = u
    for _ in range(_FIRST_POWER):
        power = power * u
    begins = 0.0 * t
    for exponent, factor in enumerate(_SLOPE, _FIRST_POWER + 1):
        begins = begins + power * (over_s * factor / exponent)
        power = power * u
    later = t - 0.5 * over_s
    starts = t.coefficients[0] < over_s
    return TaylorSeries(np.where(starts, begins.coefficients, later.coefficients))


class Stay(NamedTuple):
    """A place, m, ENU, and a heading; `None` for the vehicle's own."""

    x: float | None = None
    y: float | None = None
    height: float | None = None
    yaw: float | None = None  # degrees

    def place(self, here: Vector) -> Vector:
        x, y, z = (own if given is None else given for given, own in zip(self[:3], here, strict=True))
        return (x, y, z)

    def track(self, here: Vector, yaw_rad: float) -> Track:
        x, y, z = self.place(here)
        return Hover(
            x=round(x, 9), y=round(y, 9), height=round(z, 9), yaw=degrees(yaw_rad) if self.yaw is None else self.yaw
        ).track()


def stay_of(name: str) -> Stay | None:
    """Return the place of a valid `hover` track; `None` for other tracks."""
    base, _, options = name.partition(":")
    if base != "hover":
        return None
    pairs = (option.partition("=") for option in options.split(",") if option)
    return Stay(**{key: float(value) for key, _, value in pairs})


_KEPT = 256


class PastReference(NamedTuple):
    """A reference with its time; `track_enu_m` is `None` on the way to the track."""

    at_us: int
    position_enu_m: Vector
    track_enu_m: Vector | None
    track_s: float


class ReferenceHistory:
    def __init__(self) -> None:
        self._past: list[PastReference] = []

    def add(self, reference: PastReference) -> None:
        if self._past and reference.at_us <= self._past[-1].at_us:
            return
        self._past.append(reference)
        if len(self._past) > 2 * _KEPT:
            del self._past[:_KEPT]

    def at(self, time_us: int) -> PastReference | None:
        """Interpolate the reference at a time; `None` outside the history."""
        after = bisect_right(self._past, time_us, key=lambda past: past.at_us)
        if after == 0 or after == len(self._past):
            return None
        before, then = self._past[after - 1], self._past[after]
        part = (time_us - before.at_us) / (then.at_us - before.at_us)
        track_s = before.track_s + part * (then.track_s - before.track_s)
        place = _between(before.position_enu_m, then.position_enu_m, part)
        if before.track_enu_m is None or then.track_enu_m is None:
            return PastReference(time_us, place, None, track_s)
        return PastReference(time_us, place, _between(before.track_enu_m, then.track_enu_m, part), track_s)


def _between(first: Vector, second: Vector, part: float) -> Vector:
    x, y, z = (a + part * (b - a) for a, b in zip(first, second, strict=True))
    return (x, y, z)
