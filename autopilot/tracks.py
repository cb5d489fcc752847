"""The thesis's five tracks: position as a function of time."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Track: TypeAlias = Callable[[Array], Array]
"""Times (n,) in s -> positions (n, 3) in m, ENU."""

DURATION_S = 100.0

_RADIUS_M = 2.0
_TURNS_PER_S = 0.025
_CLIMB_M_S = 0.03
_START_HEIGHT_M = 2.0


class TrackError(Exception):
    """There is no such track."""


def spiral(t: Array) -> Array:
    """Climb on a circle."""
    alpha = _alpha(t)
    return np.stack([_RADIUS_M * np.cos(alpha), _RADIUS_M * np.sin(alpha), _climb(t)], axis=-1)


def expanding_spiral(t: Array) -> Array:
    """Climb on a circle that widens by 0.2 m/s."""
    alpha, radius = _alpha(t), _RADIUS_M * t / 10.0 + _RADIUS_M
    return np.stack([radius * np.cos(alpha), radius * np.sin(alpha), _climb(t)], axis=-1)


def line(t: Array) -> Array:
    """Climb along a straight line."""
    return np.stack([t / 10.0 + 1.0, t / 10.0 - 2.0, _climb(t)], axis=-1)


def wave(t: Array) -> Array:
    """Swing in x while flying along y at 2 m/s."""
    return np.stack([_RADIUS_M * np.cos(_alpha(t)), 2.0 * t, _climb(t)], axis=-1)


def crown(t: Array) -> Array:
    """Circle while the height swings by 1.5 m."""
    alpha = _alpha(t)
    height = _START_HEIGHT_M + 1.5 * np.sin(t)
    return np.stack([_RADIUS_M * np.cos(alpha), _RADIUS_M * np.sin(alpha), height], axis=-1)


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


def _alpha(t: Array) -> Array:
    return 2.0 * np.pi * _TURNS_PER_S * t


def _climb(t: Array) -> Array:
    return _START_HEIGHT_M + _CLIMB_M_S * t
