"""Duration of a flight plus penalty on exceeded limits, with its gradient.

Source: Z. Wang, X. Zhou, C. Xu and F. Gao, IEEE Transactions on Robotics 38 (2022). Demands are differentiated
numerically, so that their formulas stay in `reach`.
"""

from math import factorial, inf

import numpy as np

from colibri.autopilot.guidance.trajectories.minimum_snap import (
    SNAP,
    balanced,
    elements,
    from_ends,
    minimal_knots,
    powers,
    stiffness,
)
from colibri.autopilot.guidance.trajectories.reach import Derivatives, Reach
from colibri.autopilot.guidance.trajectories.waypoint_file import Waypoints
from colibri.common.matrices import matmul
from colibri.common.types import Array

_INTERVALS = 8  # sampling intervals of a piece
_STEPS = (1e-6, 1e-6, 1e-5, 1e-4)  # difference steps of velocity, acceleration, jerk and snap
_ORDERS = np.tile(np.arange(float(SNAP)), 2)


class FlightCost:
    """Cost as a function of leg times and free points, of which each leg has `pieces`.

    `weight` is of the squared excess in parts of its range (m below the floor), integrated over time; `charge_ah` was
    taken before; `tightened` is the part of each demand's range, (demands,), reserved beyond the margin.
    """

    def __init__(self, reach: Reach, waypoints: Waypoints, pieces: int) -> None:
        self.weight, self.charge_ah, self.floor_m, self.tightened = 0.0, 0.0, -inf, np.zeros(1)
        self._reach, self._pieces = reach, pieces
        self._given, self._margin, self._openings = waypoints.points_enu_m, waypoints.margin, waypoints.openings
        self._stiffness = stiffness(SNAP)
        self._sampling = _sampling()
        self._share = np.full(_INTERVALS + 1, 1.0 / _INTERVALS)
        self._share[[0, -1]] *= 0.5

    def variables(self, legs_s: Array, points: Array) -> Array:
        """Convert leg times, s, and all points, (legs pieces + 1, 3), to unbounded variables."""
        chosen = np.arange(len(points)) % self._pieces > 0
        places = np.empty(0) if self._openings is None else self._openings.variables(points[~chosen]).ravel()
        return np.concatenate([_root(legs_s), points[chosen].ravel(), places])

    def flight(self, x: Array) -> tuple[Array, Array]:
        legs = len(self._given) - 1
        points = np.empty((legs * self._pieces + 1, 3))
        chosen = np.arange(len(points)) % self._pieces > 0
        between, places = np.split(x[legs:].reshape(-1, 3), [chosen.sum()])
        points[chosen] = between
        points[~chosen] = self._given if self._openings is None else self._openings.points(places)
        return _duration(x[:legs])[0], points

    def __call__(self, x: Array) -> tuple[float, Array]:
        legs_s, points = self.flight(x)
        durations = np.repeat(legs_s / self._pieces, self._pieces)
        forms = elements(durations, self._stiffness)
        ends = _at_ends(minimal_knots(forms, points))
        scale = np.tile(powers(durations, SNAP), 2)[:, :, None]
        per_s = 1.0 / powers(durations, SNAP + 1).T[:, None, :, None]
        own = matmul(self._sampling, np.moveaxis(scale * ends, 0, 1).reshape(2 * SNAP, -1))
        motion = per_s * own.reshape(SNAP + 1, _INTERVALS + 1, len(durations), 3)
        density, pull = self._penalty(motion)
        penalty = self.weight * (self._share[:, None] * density).sum(axis=0)
        pull *= self.weight * self._share[:, None, None] * durations[:, None]
        slopes = _Slopes(forms, ends, durations)
        slopes.of_durations += 1.0 + penalty
        slopes.of_durations -= _total(np.arange(SNAP + 1.0)[:, None, None, None] * pull * motion, 2) / durations
        forces = matmul(self._sampling.T, (per_s * pull).reshape(len(self._sampling), -1))
        slopes.add(scale * np.moveaxis(forces.reshape(2 * SNAP, len(durations), 3), 0, 1))
        by_legs = slopes.of_durations.reshape(-1, self._pieces).sum(axis=1) / self._pieces
        chosen = np.arange(len(points)) % self._pieces > 0
        parts = [by_legs * _duration(x[: len(legs_s)])[1], slopes.of_points[chosen].ravel()]
        if self._openings is not None:
            places = x[-3 * len(self._given) :].reshape(-1, 3)
            parts.append(self._openings.slopes(places, slopes.of_points[~chosen]).ravel())
        gradient = np.concatenate(parts)
        return float((durations * (1.0 + penalty)).sum()), gradient

    def _penalty(self, motion: Array) -> tuple[Array, Array]:
        """Return penalty, (samples, pieces), and slope, (derivatives, samples, pieces, 3)."""
        slope = np.zeros_like(motion)
        low = np.maximum(self.floor_m - motion[0, :, :, 2], 0.0)
        slope[0, :, :, 2] = -2.0 * low
        states = motion[1:].reshape(SNAP, -1, 3)
        beyond = self._beyond(states)
        excess = np.maximum(beyond, 0.0)
        some = np.flatnonzero(excess.max(axis=0) > 0.0)
        slopes = slope[1:].reshape(SNAP, -1, 3)
        if len(some):
            slopes[:, some] = self._slope(states[:, some], beyond[:, some], excess[:, some])
        slope[1:] = slopes.reshape(motion[1:].shape)
        return low * low + (excess * excess).sum(axis=0).reshape(low.shape), slope

    def _slope(self, states: Array, beyond: Array, excess: Array) -> Array:
        """Return the slope of the squared excess with velocity to snap, (4, n, 3)."""
        moved = np.repeat(states[:, None], 3 * SNAP, axis=1)
        slope = np.empty_like(states)
        for order, step in enumerate(_STEPS):
            for axis in range(3):
                moved[order, 3 * order + axis, :, axis] += step
        change = self._beyond(moved.reshape(SNAP, -1, 3)).reshape(len(beyond), 3 * SNAP, -1) - beyond[:, None]
        products = (2.0 * excess[:, None] * change).sum(axis=0)
        for order, step in enumerate(_STEPS):
            slope[order] = products[3 * order : 3 * order + 3].T / step
        return slope

    def _beyond(self, states: Array) -> Array:
        """Return the excess over each limit for velocity to snap, (demands, n)."""
        demands = self._reach.demands(Derivatives(*states), self.charge_ah)
        return np.stack([demand.beyond(self._margin) for demand in demands]) + self.tightened[:, None]


class _Slopes:
    """Slopes with durations and points of a minimum-snap path."""

    def __init__(self, forms: Array, ends: Array, durations: Array) -> None:
        self._forms, self._ends, self._durations = forms, ends, durations
        self.of_durations = np.zeros(len(durations))
        self.of_points = np.zeros((len(durations) + 1, 3))

    def add(self, forces: Array) -> None:
        """Add a cost with slopes `forces`, (pieces, 8, 3), by the adjoint."""
        at_knots = _at_knots(forces)
        answer = np.zeros((*at_knots.shape[:2], 3))
        if len(answer) > 2:
            answer[1:-1, 1:] = balanced(self._forms, at_knots[1:-1, 1:])
        answers = _at_ends(answer)
        tension, reaction = self._applied(self._ends), self._applied(answers)
        orders = _ORDERS[:, None]
        change = (orders - (2.0 * SNAP - 1.0)) * answers * tension + orders * self._ends * reaction
        self.of_durations += _total(orders * forces * self._ends - change, 0) / self._durations
        self.of_points += (at_knots - _at_knots(reaction))[:, 0]

    def _applied(self, ends: Array) -> Array:
        """Multiply each element by end derivatives, (pieces, 8, 3)."""
        forms = self._forms.reshape(-1, 2 * SNAP, 2 * SNAP)
        applied: Array = (forms[:, :, :, None] * ends[:, None]).sum(axis=2)
        return applied


def _sampling() -> Array:
    """Return the matrix from end derivatives to samples of position to snap, (5 samples, 8)."""
    tau = np.arange(_INTERVALS + 1.0) / _INTERVALS
    rows = np.zeros((SNAP + 1, len(tau), 2 * SNAP))
    for order in range(SNAP + 1):
        power = np.ones_like(tau)
        for column in range(order, 2 * SNAP):
            rows[order, :, column] = factorial(column) / factorial(column - order) * power
            power = power * tau
    return matmul(rows.reshape(-1, 2 * SNAP), from_ends(SNAP))


def _at_ends(knots: Array) -> Array:
    """Convert knots, (pieces + 1, 4, 3), to piece ends, (pieces, 8, 3)."""
    return np.concatenate([knots[:-1], knots[1:]], axis=1)


def _at_knots(ends: Array) -> Array:
    """Sum piece ends, (pieces, 8, 3), at the knots, (pieces + 1, 4, 3)."""
    knots = np.zeros((len(ends) + 1, SNAP, 3))
    knots[:-1] += ends[:, :SNAP]
    knots[1:] += ends[:, SNAP:]
    return knots


def _total(values: Array, pieces_axis: int) -> Array:
    moved = np.moveaxis(values, pieces_axis, -1)
    total: Array = moved.reshape(-1, moved.shape[-1]).sum(axis=0)
    return total


def _duration(root: Array) -> tuple[Array, Array]:
    """Return positive durations, s, and their slopes; 1 s at 0."""
    below = 1.0 / ((0.5 * np.minimum(root, 0.0) - 1.0) * np.minimum(root, 0.0) + 1.0)
    above = (0.5 * np.maximum(root, 0.0) + 1.0) * np.maximum(root, 0.0)
    longer = root > 0.0
    return np.where(longer, 1.0 + above, below), np.where(longer, 1.0 + root, (1.0 - root) * below * below)


def _root(duration_s: Array) -> Array:
    longer = np.sqrt(2.0 * np.maximum(duration_s, 1.0) - 1.0) - 1.0
    return np.where(duration_s > 1.0, longer, 1.0 - np.sqrt(2.0 / np.minimum(duration_s, 1.0) - 1.0))
