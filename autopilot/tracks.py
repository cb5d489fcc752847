"""The tracks: position as a formula of time, from which every derivative follows."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from autopilot.jet import Jet, cos, sin

Array: TypeAlias = NDArray[np.float64]
Track: TypeAlias = Callable[[Jet], tuple[Jet, Jet, Jet]]
"""Time in s -> x, y, z in m, ENU."""

DURATION_S = 100.0

_RADIUS_M = 2.0
_TURNS_PER_S = 0.025
_CLIMB_M_S = 0.03
_START_HEIGHT_M = 2.0


class TrackError(Exception):
    """There is no such track."""


def spiral(t: Jet) -> tuple[Jet, Jet, Jet]:
    """Climb on a circle."""
    alpha = _alpha(t)
    return _RADIUS_M * cos(alpha), _RADIUS_M * sin(alpha), _climb(t)


def expanding_spiral(t: Jet) -> tuple[Jet, Jet, Jet]:
    """Climb on a circle that widens by 0.2 m/s."""
    alpha, radius = _alpha(t), _RADIUS_M * 0.1 * t + _RADIUS_M
    return radius * cos(alpha), radius * sin(alpha), _climb(t)


def line(t: Jet) -> tuple[Jet, Jet, Jet]:
    """Climb along a straight line."""
    return 0.1 * t + 1.0, 0.1 * t - 2.0, _climb(t)


def wave(t: Jet) -> tuple[Jet, Jet, Jet]:
    """Swing in x while flying along y at 2 m/s."""
    return _RADIUS_M * cos(_alpha(t)), 2.0 * t, _climb(t)


def crown(t: Jet) -> tuple[Jet, Jet, Jet]:
    """Circle while the height swings by 1.5 m."""
    alpha = _alpha(t)
    return _RADIUS_M * cos(alpha), _RADIUS_M * sin(alpha), 1.5 * sin(t) + _START_HEIGHT_M


TRACKS: dict[str, Track] = {
    "spiral": spiral,
    "expanding-spiral": expanding_spiral,
    "line": line,
    "wave": wave,
    "crown": crown,
}


def track(name: str) -> Track:
    """Return the track of that name.

    Raises:
        TrackError: There is no such track.
    """
    if name not in TRACKS:
        raise TrackError(f"unknown track {name}: choose {', '.join(TRACKS)}")
    return TRACKS[name]


def position(track: Track, t: Array, derivative: int = 0) -> Array:
    """Return a derivative of the position on a track, (n, 3), in m / s^derivative, ENU.

    Args:
        track: The track.
        t: Times, s, (n,).
        derivative: 0 for the position itself.
    """
    time = Jet.time(np.asarray(t, dtype=np.float64), derivative)
    return np.stack([axis.derivative(derivative) for axis in track(time)], axis=-1)


def _alpha(t: Jet) -> Jet:
    return 2.0 * np.pi * _TURNS_PER_S * t


def _climb(t: Jet) -> Jet:
    return _CLIMB_M_S * t + _START_HEIGHT_M
