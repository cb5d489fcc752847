"""The attitude's nonlinear equations under the certified law, many flights at once: does any leave its set?

Not the LPV model: trigonometric functions of the angles, Euler's equation with the rotors' momentum and the lag of the
moments, integrated with Runge-Kutta 4 four times in a control interval.
"""

from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.lpv_mpc.prediction import INPUTS, M1, PHI, PSI, RATES, STATES, THETA, P, Q, R
from colibri.certification.attitude import AttitudeNumbers
from colibri.certification.lyapunov import Proof
from colibri.common.types import Array

_SUBSTEPS = 4
_RATES = list(RATES)
_RESONANCE_RAD_S = 28.0
"""Of roll and pitch in profile flight."""
_KINDS = 4
_INSIDE = 1.0 - 1e-9
_NO_LENGTH = 1e-12


class Flown(NamedTuple):
    """Flights of one set.

    Attributes:
        states: Errors at each sample, (steps + 1, flights, 12).
        values: V of them, (steps + 1, flights).
    """

    states: Array
    values: Array


class Interval(NamedTuple):
    """What stays the same over a control interval.

    Attributes:
        commands, disturbance_n_m: N m, (flights, 3) each.
        held: phi and theta that are held, rad, (flights, 2).
        momentum: h of the rotors, N m s, (flights,).
        inertia: (3,).
        lag_s: Of the moments.
    """

    commands: Array
    disturbance_n_m: Array
    held: Array
    momentum: Array
    inertia: Array
    lag_s: float


def fly(numbers: AttitudeNumbers, proof: Proof, references: Array, flights: int, duration_s: float, seed: int) -> Flown:
    """Fly from the border of the set V <= 1, each to a constant attitude, disturbed as much as is allowed.

    A quarter each by a constant moment, by another one every sample, by one that swings at the loop's resonance, and by
    the moment that raises V most. The rotors' momentum is anything within its range, another one every sample.

    Args:
        numbers: Of the loop.
        proof: Of the set.
        references: Largest phi and theta to hold, rad, (2,).
        flights: How many.
        duration_s: Of each.
        seed: Of all that is random.
    """
    rng = np.random.default_rng(seed)
    z = np.linalg.solve(np.linalg.cholesky(proof.P).T, _directions(rng, flights, STATES + INPUTS).T).T * _INSIDE
    held = rng.uniform(-1.0, 1.0, (flights, 2)) * references
    constant, kinds = _directions(rng, flights, INPUTS), np.arange(flights)[:, None] % _KINDS
    gain, inertia = np.array(numbers.gain), np.array(numbers.inertia_kg_m2)
    states = [z]
    for step in range(round(duration_s / numbers.interval_s)):
        commands = z[:, STATES:] - z @ gain.T
        swinging = constant * np.sin(_RESONANCE_RAD_S * numbers.interval_s * step)
        worst = _unit(z @ proof.P[:, _RATES] / inertia)
        disturbance_n_m = numbers.disturbance_n_m * np.choose(
            kinds, [constant, _directions(rng, flights, INPUTS), swinging, worst]
        )
        momentum = rng.uniform(-1.0, 1.0, flights) * numbers.momentum_n_m_s
        interval = Interval(commands, disturbance_n_m, held, momentum, inertia, numbers.lag_s)
        z = np.hstack([integrate(z[:, :STATES], interval, numbers.interval_s), commands])
        states.append(z)
    flown = np.array(states)
    return Flown(flown, np.einsum("tfi,ij,tfj->tf", flown, proof.P, flown))


def integrate(x: Array, interval: Interval, duration_s: float) -> Array:
    """Return the states, (flights, 9), at the end of an interval that begins at `x`, (flights, 9)."""
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
    """Return x', (flights, 9): [2.7], Euler's equation, and the lag."""
    phi, theta = x[:, PHI] + interval.held[:, 0], x[:, THETA] + interval.held[:, 1]
    rate, moment = x[:, _RATES], x[:, M1:]
    p, q, r = rate.T
    carried = interval.inertia * rate
    carried[:, 2] += interval.momentum
    turn = (moment + interval.disturbance_n_m - np.cross(rate, carried)) / interval.inertia
    across = np.sin(phi) * q + np.cos(phi) * r
    change = np.zeros_like(x)
    change[:, PHI] = p + np.tan(theta) * across
    change[:, THETA] = np.cos(phi) * q - np.sin(phi) * r
    change[:, PSI] = across / np.cos(theta)
    change[:, [P, Q, R]] = turn
    if interval.lag_s:
        change[:, M1:] = (interval.commands - moment) / interval.lag_s
    return change


def _directions(rng: np.random.Generator, count: int, size: int) -> Array:
    return _unit(rng.normal(size=(count, size)))


def _unit(vectors: Array) -> Array:
    units: Array = vectors / np.maximum(np.linalg.norm(vectors, axis=1), _NO_LENGTH)[:, None]
    return units
