"""The fastest flight through waypoints.

First leg times are optimised, then legs are halved repeatedly to add free points, each stage with a light penalty
first. Finally the flight is slowed down until all limits hold.
"""

from dataclasses import replace
from math import inf

import numpy as np

from colibri.autopilot.guidance.trajectories.csv_table import MAX_DURATION_S
from colibri.autopilot.guidance.trajectories.fitting import check_heights, dips_of
from colibri.autopilot.guidance.trajectories.reach import Demand, Reach, exact_motion
from colibri.autopilot.guidance.trajectories.time_optimal.cost import FlightCost
from colibri.autopilot.guidance.trajectories.time_optimal.lbfgs import minimise
from colibri.autopilot.guidance.trajectories.tracks import Track, position, through
from colibri.autopilot.guidance.trajectories.waypoint_file import Waypoints
from colibri.common.types import Array

_PIECES, _LEAST_PIECES, _MOST_PIECES = 8, 32, 1024  # pieces of a leg, and bounds on those of all legs
_WEIGHTS = (1e2, 1e4)  # successive weights of the penalty
_ITERATIONS = 250
_TOLERANCE, _ROUGH_TOLERANCE = 2e-5, 1e-4  # of the last stage, and before
_CLEARANCE_M = 0.01  # above the floor; increased by dips found
_LIFTS, _TIGHTENINGS = 10, 4
_SLOWER = (0.0005, 0.05)  # bounds of the slow-down in one pass


def fastest(waypoints: Waypoints, reach: Reach, floor_m: float) -> tuple[Track, str]:
    """Return the fastest track and its description, or raise TrackFileError."""
    check_heights(waypoints, floor_m)
    legs_s, points, pieces = np.diff(waypoints.times_s), waypoints.points_enu_m, 1
    while True:
        last = pieces >= _wanted_pieces(len(legs_s))
        legs_s, points = _optimised(waypoints, reach, floor_m, legs_s, points, last=last)
        if last:
            return _within(waypoints, reach, legs_s, points)
        pieces *= 2
        points = position(_track(waypoints, legs_s, points), _knots(legs_s, pieces))
        points[:, 2] = np.maximum(points[:, 2], floor_m)


def _wanted_pieces(legs: int) -> int:
    pieces = _PIECES
    while pieces * legs < _LEAST_PIECES:
        pieces *= 2
    while pieces * legs > _MOST_PIECES and pieces > 2:
        pieces //= 2
    return pieces


def _optimised(
    waypoints: Waypoints, reach: Reach, floor_m: float, legs_s: Array, points: Array, *, last: bool
) -> tuple[Array, Array]:
    """Return better leg times and points; the battery's state is that of the previous flight."""
    pieces = (len(points) - 1) // len(legs_s)
    cost = FlightCost(reach, waypoints, pieces)
    cost.floor_m = floor_m + _CLEARANCE_M if pieces > 1 else -inf
    x, weights, lifts, tightenings = cost.variables(legs_s, points), list(_WEIGHTS), 0, 0
    while weights:
        cost.weight = weights.pop(0)
        cost.charge_ah = reach.charge_of(exact_motion(_track(waypoints, legs_s, points)))
        x = minimise(cost, x, _ITERATIONS, _TOLERANCE if last else _ROUGH_TOLERANCE)
        legs_s, points = cost.flight(x)
        if weights or pieces == 1:
            continue
        track = _track(waypoints, legs_s, points)
        dips = list(dips_of(track, floor_m))
        if dips and lifts == _LIFTS:
            raise waypoints.error(f"it cannot be held above the floor of {floor_m:g} m: add a waypoint")
        if dips:
            cost.floor_m += 2.0 * (floor_m - min(height_m for _, height_m in dips))
            weights, lifts = [cost.weight], lifts + 1
        elif last and tightenings < _TIGHTENINGS:
            beyond = np.array([worst for worst, _ in _beyond(waypoints, reach, track)])
            if beyond.max() > 0.0:
                cost.tightened = cost.tightened + np.maximum(beyond, 0.0)
                weights, tightenings = [cost.weight], tightenings + 1
    return legs_s, points


def _beyond(waypoints: Waypoints, reach: Reach, track: Track) -> list[tuple[float, Demand]]:
    """Return the largest excess of each demand."""
    motion = exact_motion(track)
    demands = reach.demands(motion, reach.charge_of(motion))
    return [(float(demand.beyond(waypoints.margin).max()), demand) for demand in demands]


def _within(waypoints: Waypoints, reach: Reach, legs_s: Array, points: Array) -> tuple[Track, str]:
    while True:
        track = _track(waypoints, legs_s, points)
        found = _beyond(waypoints, reach, track)
        beyond, worst = max(found, key=lambda one: one[0])
        if beyond <= 0.0:
            break
        legs_s = (1.0 + min(max(0.2 * beyond, _SLOWER[0]), _SLOWER[1])) * legs_s
        if legs_s.sum() > MAX_DURATION_S:
            raise waypoints.error(f"not to be flown within {MAX_DURATION_S:g} s: it needs a {worst}")
    _check_directions(waypoints, track)
    velocity = exact_motion(track).velocity
    top_m_s = np.sqrt((velocity * velocity).sum(axis=1).max())
    share = found[0][1].values.max() / found[0][1].limit
    return track, f"fastest: {track.duration_s:.2f} s, up to {top_m_s:.1f} m/s and {share:.0%} of the thrust"


def _check_directions(waypoints: Waypoints, track: Track) -> None:
    if waypoints.facing is None or track.waypoints is None:
        return
    along = (position(track, track.waypoints.times_s, 1) * waypoints.facing).sum(axis=1)
    for row in np.flatnonzero(along[1:-1] < 0.0)[:1] + 1:
        raise waypoints.error(f"window {row + 1} would be flown through from behind: add a waypoint before it")


def _track(waypoints: Waypoints, legs_s: Array, points: Array) -> Track:
    pieces = (len(points) - 1) // len(legs_s)
    between = np.arange(len(points)) % pieces > 0
    passed = np.concatenate([_knots(legs_s, pieces)[:, None], points], axis=1)
    moved = replace(waypoints, times_s=passed[~between, 0], points_enu_m=points[~between])
    return through(moved, between=passed[between])


def _knots(legs_s: Array, pieces: int) -> Array:
    return np.concatenate([[0.0], np.cumsum(np.repeat(legs_s / pieces, pieces))])
