"""Minimum-snap paths held above the floor and slowed down to a vehicle's limits.

A dip below the floor passes an additional point above it; legs beyond the limits are stretched in time. Feasible paths
stay unchanged, bit for bit.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from colibri.autopilot.guidance.trajectories.csv_table import MAX_DURATION_S
from colibri.autopilot.guidance.trajectories.reach import INTERVAL_S, Demand, Reach, exact_motion, mean_motion, times
from colibri.autopilot.guidance.trajectories.tracks import Track, position, through
from colibri.autopilot.guidance.trajectories.waypoint_file import Waypoints
from colibri.common.types import Array

ROUNDING_M = 1e-3  # tolerance below the floor
_CLEARANCE_M = 0.25  # height of a corrected dip, if both ends of its leg are at least twice as high
_HOLDS = 20
_STRETCHES = 80
_STRETCH = (1.02, 1.25)  # of a leg in one pass
_WIDENING = 4  # passes after which twice as many neighbours are stretched too: finally all, which leads to a hover
_LISTED = 3


class Dip(NamedTuple):
    """Lowest point below the floor; legs count from 0."""

    leg: int
    time_s: float
    height_m: float


def fit(waypoints: Waypoints, reach: Reach, floor_m: float) -> tuple[Track, str]:
    """Return the feasible track, and its changes as text, or raise TrackFileError."""
    check_heights(waypoints, floor_m)
    if waypoints.timed:
        return _as_timed(waypoints, reach, floor_m), ""
    stretch, slowed, limiting = np.ones(len(waypoints.times_s) - 1), waypoints, ""
    for count in range(_STRETCHES):
        track, dips = _held(slowed, floor_m)
        demands = reach.demands(exact_motion(track), reach.charge_of_hover(track.duration_s))
        excess, worst = _excess(demands, slowed, waypoints.margin)
        if excess.max() <= 1.0:
            changes = (_held_in_words(dips, floor_m), _stretched_in_words(stretch, limiting))
            return track, "; ".join(filter(None, changes))
        limiting = limiting or worst.name
        neighbours = min(2 ** (count // _WIDENING) - 1, len(excess))  # the largest of each leg and those counts
        excess = sliding_window_view(np.pad(excess, neighbours), 2 * neighbours + 1).max(axis=1)
        stretch *= np.where(excess > 1.0, np.clip(np.sqrt(excess), *_STRETCH), 1.0)
        slowed = waypoints.stretched(stretch)
        if slowed.times_s[-1] > MAX_DURATION_S:
            break
    raise waypoints.error(f"not to be flown within {MAX_DURATION_S:g} s: it needs a {worst}")


def check_heights(waypoints: Waypoints, floor_m: float) -> None:
    for row in np.flatnonzero(waypoints.points_enu_m[:, 2] < floor_m - ROUNDING_M)[:1]:
        height_m = waypoints.points_enu_m[row, 2]
        raise waypoints.error(f"waypoint {row + 1} is at {height_m:g} m, below the floor of {floor_m:g} m")


def dips_of(track: Track, floor_m: float) -> Iterator[tuple[float, float]]:
    """Yield time, s, and height, m, of each dip."""
    t = times(track)
    z = position(track, t)[:, 2]
    below = np.concatenate([[0], z < floor_m - ROUNDING_M, [0]]).astype(np.int8)
    for begin, end in np.flatnonzero(np.diff(below)).reshape(-1, 2):
        lowest = begin + int(np.argmin(z[begin:end]))
        yield float(t[lowest]), float(z[lowest])


def _as_timed(waypoints: Waypoints, reach: Reach, floor_m: float) -> Track:
    track = through(waypoints)
    for dip in _dips(track, waypoints, floor_m):
        what = f"{_legs([dip.leg])} dips to {dip.height_m:.2f} m, below the floor of {floor_m:g} m"
        raise waypoints.error(f"{what}: add a waypoint there, or leave column t out")
    demands = reach.demands(mean_motion(track), reach.charge_of_hover(track.duration_s))
    excess, worst = _excess(demands, waypoints, 0.0)
    if excess.max() > 1.0:
        what = f"{_legs([int(excess.argmax())])} needs a {worst}"
        raise waypoints.error(f"{what}: give it more time, or leave column t out")
    return track


def _excess(demands: Sequence[Demand], waypoints: Waypoints, margin: float) -> tuple[Array, Demand]:
    """Return each leg's relative demand, (n - 1,), and the worst."""
    excess = np.array([demand.excess(margin) for demand in demands])
    worst = demands[int(excess.max(axis=1).argmax())]
    begins = np.ceil(waypoints.times_s[:-1] / INTERVAL_S).astype(np.intp)
    return np.maximum.reduceat(excess.max(axis=0), begins), worst


def _held(waypoints: Waypoints, floor_m: float) -> tuple[Track, list[Dip]]:
    track = through(waypoints)
    dips = found = _dips(track, waypoints, floor_m)
    heights = np.empty((0, 2))
    for _ in range(_HOLDS):
        if not found:
            return track, dips
        heights = np.concatenate([heights, [(dip.time_s, _height_over(waypoints, dip.leg, floor_m)) for dip in found]])
        track = through(waypoints, heights)
        found = _dips(track, waypoints, floor_m)
    what = f"{_legs([found[0].leg])} cannot be held above the floor of {floor_m:g} m"
    raise waypoints.error(f"{what}: add a waypoint there")


def _height_over(waypoints: Waypoints, leg: int, floor_m: float) -> float:
    ends = waypoints.points_enu_m[leg : leg + 2, 2]
    return floor_m + min(_CLEARANCE_M, 0.5 * max(float(ends.min()) - floor_m, 0.0))


def _dips(track: Track, waypoints: Waypoints, floor_m: float) -> list[Dip]:
    return [Dip(waypoints.leg_at(time_s), time_s, height_m) for time_s, height_m in dips_of(track, floor_m)]


def _held_in_words(dips: Sequence[Dip], floor_m: float) -> str:
    lowest: dict[int, float] = {}
    for dip in dips:
        lowest[dip.leg] = min(dip.height_m, lowest.get(dip.leg, dip.height_m))
    if not lowest:
        return ""
    verb = "dips" if len(lowest) == 1 else "dip"
    return f"{_legs(list(lowest))} {verb} to {_figures(list(lowest.values()))} m: held above {floor_m:g} m"


def _stretched_in_words(stretch: Array, limiting: str) -> str:
    legs = np.flatnonzero(stretch > 1.0)
    return f"{_legs(legs.tolist())} stretched by {_figures(stretch[legs].tolist())}: {limiting}" if len(legs) else ""


def _legs(legs: Sequence[int]) -> str:
    if len(legs) > _LISTED:
        return f"{len(legs)} legs"
    return f"leg{'s' if len(legs) > 1 else ''} {_listed([f'{leg + 1} to {leg + 2}' for leg in legs])}"


def _figures(figures: Sequence[float]) -> str:
    if len(figures) > _LISTED:
        return f"{min(figures):.2f} to {max(figures):.2f}"
    return _listed([f"{figure:.2f}" for figure in figures])


def _listed(words: list[str]) -> str:
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
