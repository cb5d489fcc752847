"""The attitude's nonlinear equations under a certified law, many flights at once: does any leave its set?

Not the LPV model: the law's own kinematics, Euler's equation with the rotors' momentum and the lag of the moments,
integrated with Runge-Kutta 4 four times in a control interval.
"""

from collections.abc import Callable
from typing import NamedTuple, Protocol, TypeAlias

import numpy as np

from colibri.autopilot.control.lpv_mpc.prediction import ANGLES, INPUTS, M1, RATES, STATES
from colibri.certification.attitude import AttitudeNumbers
from colibri.certification.certificate import CertifiedLaw, Entry
from colibri.common.types import Array

_SUBSTEPS = 4
_ANGLES, _RATES = list(ANGLES), list(RATES)
_RESONANCE_RAD_S = 28.0
"""Of roll and pitch in profile flight."""
_KINDS = 4
_INSIDE = 1.0 - 1e-9
_NO_LENGTH = 1e-12

Momentum: TypeAlias = Callable[[Array, Array], tuple[Array, Array]]
"""From moments and their rates, (flights, 3), to the rotors' momentum along body z, and its rate, (flights,)."""


class Conditions(NamedTuple):
    """What a certificate is to hold for.

    Attributes:
        disturbance_n_m: Length of the moment that disturbs.
        charge_part: Part of the battery's charge that may be taken.
    """

    disturbance_n_m: float
    charge_part: float


class Flyer(Protocol):
    """A law that flies the equations."""

    def commands(self, z: Array) -> tuple[Array, Array]:
        """Return the moments that are commanded at `z`, (flights, 12), and those that are remembered, (flights, 3)."""

    def turn(self, angles: Array, rates: Array) -> Array:
        """Return how the errors of the angles change, rad/s, (flights, 3)."""

    def momentum(self) -> Momentum:
        """Return what the rotors' momentum is over the next interval."""


class AttitudeLaw(CertifiedLaw, Protocol):
    """A law of the attitude that can be certified and flown."""

    @property
    def what(self) -> str:
        """The law, as reports call it."""

    @property
    def not_proven(self) -> tuple[str, ...]:
        """What is not proven of this law, beside what is of none."""

    @property
    def axes(self) -> tuple[str, str, str]:
        """Names of the three angles."""

    @property
    def conditions(self) -> Conditions:
        """What its certificate is to hold for."""

    @property
    def terminal_weight(self) -> Array:
        """Of the law's plans, (12, 12)."""

    def thrusts_n(self, scale: float) -> tuple[float, float]:
        """Return the range of the thrust at this part of the profile's ranges."""

    def ranges(self, numbers: AttitudeNumbers) -> str:
        """Return the ranges of the angles, deg, in words."""

    def held(self, entry: Entry) -> Array:
        """Return the largest constant |phi| and |theta|, rad, (2,), around which the set of an entry may lie."""

    def flyer(self, entry: Entry, held: Array, rng: np.random.Generator) -> Flyer:
        """Return the law as it flies the equations to `held`, rad, (flights, 2)."""


class Flown(NamedTuple):
    """Flights of one set.

    Attributes:
        states: Errors at each sample, (steps + 1, flights, 12).
        values: V of them, (steps + 1, flights).
        beyond_n_m: Largest moments that were commanded beyond the certified gain, (3,).
    """

    states: Array
    values: Array
    beyond_n_m: Array


class Interval(NamedTuple):
    """What stays the same over a control interval.

    Attributes:
        commands, disturbance_n_m: N m, (flights, 3) each.
        inertia: (3,).
        lag_s: Of the moments.
        turn: See `Flyer`.
        momentum: Of the rotors.
    """

    commands: Array
    disturbance_n_m: Array
    inertia: Array
    lag_s: float
    turn: Callable[[Array, Array], Array]
    momentum: Momentum


class Plan(NamedTuple):
    """How many flights, s of each, and the seed of all that is random in them."""

    flights: int
    duration_s: float
    seed: int


def fly(law: AttitudeLaw, entry: Entry, plan: Plan) -> Flown:
    """Fly from points all over the border V = 1, towards attitudes that may be held, disturbed as allowed.

    The disturbing moment is as long as it may be: constant, another one at every sample, swinging at the resonance, or
    always the one that raises V most.
    """
    numbers, proof = entry.numbers, entry.proof
    flights, rng = plan.flights, np.random.default_rng(plan.seed)
    z = np.linalg.solve(np.linalg.cholesky(proof.P).T, _directions(rng, flights, STATES + INPUTS).T).T * _INSIDE
    held = rng.uniform(-1.0, 1.0, (flights, 2)) * law.held(entry)
    constant, kinds = _directions(rng, flights, INPUTS), np.arange(flights)[:, None] % _KINDS
    inertia, gain = np.array(numbers.inertia_kg_m2), np.array(numbers.commanded[0])
    flyer = law.flyer(entry, held, rng)
    states, beyond_n_m = [z], np.zeros(INPUTS)
    for step in range(round(plan.duration_s / numbers.interval_s)):
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
    return Flown(flown, np.einsum("tfi,ij,tfj->tf", flown, proof.P, flown), beyond_n_m)


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
    """Return x', (flights, 9): the angles', Euler's equation, and the lag."""
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
