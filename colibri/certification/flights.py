"""Fly the attitude's nonlinear equations under a certified law.

They are its kinematics, Euler's equation with the rotors' momentum, and the lag of the moments.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from colibri.certification.attitude import ANGLES, INPUTS, M1, RATES, STATES, Momentum
from colibri.certification.certificate import ProofEntry
from colibri.certification.planned_attitude import HELD_RAD, PlannedAttitude
from colibri.common.types import Array

_SUBSTEPS = 4
_ANGLES, _RATES = list(ANGLES), list(RATES)
_RESONANCE_RAD_S = 28.0
"""Of roll and pitch in profile flight."""
_KINDS = 4
_INSIDE = 1.0 - 1e-9
_NO_LENGTH = 1e-12


class FlownErrors(NamedTuple):
    """Errors, (steps + 1, flights, 12), V, and largest commands beyond the gain, (3,)."""

    states: Array
    values: Array
    beyond_n_m: Array


class Interval(NamedTuple):
    commands: Array
    disturbance_n_m: Array
    inertia: Array
    lag_s: float
    turn: Callable[[Array, Array], Array]
    momentum: Momentum


def fly(law: PlannedAttitude, entry: ProofEntry, flights: int, duration_s: float, *, seed: int) -> FlownErrors:
    """Fly from the border V = 1 to attitudes that may be held, under the largest disturbance.

    The moment is constant, random, at the resonance, or the worst for V.
    """
    numbers, proof = entry.numbers, entry.proof
    rng = np.random.default_rng(seed)
    z = np.linalg.solve(np.linalg.cholesky(proof.P).T, _directions(rng, flights, STATES + INPUTS).T).T * _INSIDE
    held = rng.uniform(-1.0, 1.0, (flights, 2)) * HELD_RAD
    constant, kinds = _directions(rng, flights, INPUTS), np.arange(flights)[:, None] % _KINDS
    inertia, gain = np.array(numbers.inertia_kg_m2), np.array(numbers.commanded[0])
    flyer = law.flyer(entry, held, rng)
    states, beyond_n_m = [z], np.zeros(INPUTS)
    for step in range(round(duration_s / numbers.interval_s)):
        commands, remembered = flyer.commands(z)
        beyond_n_m = np.maximum(beyond_n_m, np.abs(commands - z @ gain.T).max(axis=0))
        swinging = constant * np.sin(_RESONANCE_RAD_S * numbers.interval_s * step)
        worst = _unit(z @ proof.P[:, _RATES] / inertia)
        disturbance_n_m = numbers.disturbance_n_m * np.choose(
            kinds, [constant, _directions(rng, flights, INPUTS), swinging, worst]
        )
        interval = Interval(commands, disturbance_n_m, inertia, numbers.lag_s, flyer.turn, flyer.momentum())
        z = np.hstack([integrate(z[:, :STATES], interval, numbers.interval_s), remembered])
        states.append(z)
    flown = np.array(states)
    return FlownErrors(flown, np.einsum("tfi,ij,tfj->tf", flown, proof.P, flown), beyond_n_m)


def integrate(x: Array, interval: Interval, duration_s: float) -> Array:
    dt = duration_s / _SUBSTEPS
    if interval.lag_s == 0.0:
        x = np.hstack([x[:, :M1], interval.commands])
    for _ in range(_SUBSTEPS):
        k1 = _derivative(x, interval)
        k2 = _derivative(x + 0.5 * dt * k1, interval)
        k3 = _derivative(x + 0.5 * dt * k2, interval)
        k4 = _derivative(x + dt * k3, interval)
        x = x + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return x


def _derivative(x: Array, interval: Interval) -> Array:
    rate, moment = x[:, _RATES], x[:, M1:]
    change = np.zeros_like(x)
    if interval.lag_s:
        change[:, M1:] = (interval.commands - moment) / interval.lag_s
    momentum, spinning = interval.momentum(moment, change[:, M1:])
    carried = interval.inertia * rate
    carried[:, 2] += momentum
    turning = moment + interval.disturbance_n_m - np.cross(rate, carried)
    turning[:, 2] -= spinning
    change[:, _ANGLES] = interval.turn(x[:, _ANGLES], rate)
    change[:, _RATES] = turning / interval.inertia
    return change


def _directions(rng: np.random.Generator, count: int, size: int) -> Array:
    return _unit(rng.normal(size=(count, size)))


def _unit(vectors: Array) -> Array:
    units: Array = vectors / np.maximum(np.linalg.norm(vectors, axis=1), _NO_LENGTH)[:, None]
    return units
