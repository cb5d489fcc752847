"""Start a track's time smoothly, as a standing vehicle cannot follow a track that begins at speed.

The rate of the track's time rises from 0 to 1 by a polynomial whose first four derivatives vanish at both ends.
"""

from dataclasses import replace

import numpy as np

from colibri.autopilot.guidance.trajectories.taylor import TaylorSeries
from colibri.autopilot.guidance.trajectories.tracks import Place, Track

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
