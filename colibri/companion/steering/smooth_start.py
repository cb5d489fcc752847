"""A track whose time begins to pass smoothly: from rest at its first point, with no jump of any derivative that counts.

A vehicle that stands cannot be on a track that begins at speed. Over the first seconds the track's own time passes from
not at all to as on the clock, by a polynomial whose first four derivatives vanish at both ends: the vehicle is on the
track's path from the first moment on, and half of those seconds behind its time from then on.
"""

from dataclasses import replace

import numpy as np

from colibri.autopilot.guidance.trajectories.taylor import TaylorSeries
from colibri.autopilot.guidance.trajectories.tracks import Place, Track

OVER_S = 4.0
_SLOPE = (126.0, -420.0, 540.0, -315.0, 70.0)
"""Of u^5 to u^9: rises from 0 to 1 over u of 0 to 1."""
_FIRST_POWER = 5


def smoothly_started(track: Track, over_s: float = OVER_S) -> Track:
    """Return a track whose time begins to pass over `over_s`."""
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
    """Return the track's own time at times `t`."""
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
