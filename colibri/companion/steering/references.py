"""Tracks and steps of an identification as a companion flies them, and recent references.

A standing vehicle cannot follow a track that begins at speed: the track's time starts by a polynomial whose rate rises
from 0 to 1 and whose first four derivatives vanish at both ends. An estimate that arrives late is compared with the
reference of its time.
"""

from bisect import bisect_right
from dataclasses import replace
from math import degrees
from typing import NamedTuple

import numpy as np

from colibri.autopilot.guidance.trajectories.taylor import TaylorSeries
from colibri.autopilot.guidance.trajectories.tracks import Hover, Track
from colibri.common.types import Vector
from colibri.mavlink.hil.state import StateFrame

OVER_S = 4.0
_SLOPE = (126.0, -420.0, 540.0, -315.0, 70.0)  # coefficients of u^5 to u^9, over u = 0..1
_FIRST_POWER = 5


def smoothly_started(track: Track) -> Track:
    look, duration_s = track.yaw, track.duration_s + 0.5 * OVER_S
    yaw = None if look is None else lambda t: look(_warped(t))
    return replace(track, position=lambda t: track.position(_warped(t)), yaw=yaw, duration_s=duration_s)


def _warped(t: TaylorSeries) -> TaylorSeries:
    u = t / OVER_S
    power = u
    for _ in range(_FIRST_POWER):
        power = power * u
    begins = 0.0 * t
    for exponent, factor in enumerate(_SLOPE, _FIRST_POWER + 1):
        begins = begins + power * (OVER_S * factor / exponent)
        power = power * u
    later = t - 0.5 * OVER_S
    starts = t.coefficients[0] < OVER_S
    return TaylorSeries(np.where(starts, begins.coefficients, later.coefficients))


class Stay(NamedTuple):
    """A place, m, ENU, and a heading; `None` for the vehicle's."""

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
    """Return the place of a valid `hover` track, else `None`."""
    base, _, options = name.partition(":")
    if base != "hover":
        return None
    pairs = (option.partition("=") for option in options.split(",") if option)
    return Stay(**{key: float(value) for key, _, value in pairs})


_KEPT = 256


class PastReference(NamedTuple):
    """A reference; `track_enu_m` is `None` before the track."""

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


ROUNDS = 3
PAUSE_S = 1.2  # rest between two doublets


class Doublet(NamedTuple):
    """A rate added about an axis (0..2), then its opposite, for `half_s` each."""

    axis: int
    rate_rad_s: float
    half_s: float


DOUBLETS = (Doublet(0, 0.4, 0.2), Doublet(1, 0.4, 0.2), Doublet(2, 0.4, 0.4))
_NOTHING: Vector = (0.0, 0.0, 0.0)


def duration_s() -> float:
    return ROUNDS * sum(PAUSE_S + 2.0 * doublet.half_s for doublet in DOUBLETS)


def step_at(time_s: float) -> Vector:
    left_s = time_s % (duration_s() / ROUNDS)
    for doublet in DOUBLETS:
        left_s -= PAUSE_S
        if left_s < 0.0:
            return _NOTHING
        if left_s < 2.0 * doublet.half_s:
            rate = doublet.rate_rad_s if left_s < doublet.half_s else -doublet.rate_rad_s
            p, q, r = (rate if axis == doublet.axis else 0.0 for axis in range(3))
            return (p, q, r)
        left_s -= 2.0 * doublet.half_s
    return _NOTHING


class StepFlight:
    """Adds the steps to body rates; rows of `commanded` and `measured` are time, s, p, q, r, rad/s."""

    def __init__(self) -> None:
        self.commanded: list[tuple[float, float, float, float]] = []
        self.measured: list[tuple[float, float, float, float]] = []
        self._began_us: int | None = None

    def begin(self, at_us: int) -> None:
        self._began_us = at_us

    def is_over(self, now_us: int) -> bool:
        return self._began_us is not None and (now_us - self._began_us) * 1e-6 >= duration_s()

    def rates(self, rate_flu_rad_s: Vector, now_us: int, arrives_us: int) -> Vector:
        """Return the rates to command now, which arrive at `arrives_us`."""
        if self._began_us is None:
            return rate_flu_rad_s
        step = step_at((now_us - self._began_us) * 1e-6)
        p, q, r = (a + b for a, b in zip(rate_flu_rad_s, step, strict=True))
        self.commanded.append((arrives_us * 1e-6, p, q, r))
        return p, q, r

    def add(self, at_us: int, state: StateFrame) -> None:
        if self._began_us is not None:
            self.measured.append((at_us * 1e-6, *state.rate_flu_rad_s))
