"""The attitude under a law that commands moments, as an uncertain loop (docs/certificate.md).

State, 12: errors of the attitude, angles as in `of_error`, each before its body rate; moments M1, M2, M3;
and the remembered commands. Over an interval h

    ω(h) = ω + h G ω + I⁻¹ (b1 M + b2 u) + κ e3 (M(h) - M) + ξ_ω
    Φ(h) = Φ + T (h ω + I⁻¹ (c1 M + c2 u) + ...) + ξ_Φ
    u = C z + ξ_u

with G and T, the mean gyroscopic and kinematic matrices, in convex hulls, ξ bounded entry by entry, and κ for the
reaction to spinning rotors up.
"""

from collections.abc import Callable
from itertools import product
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from colibri.certification.loop import AnyArray, Number, RangeError, UncertainLoop
from colibri.common.types import Array

PHI, P, THETA, Q, PSI, R, M1, M2, M3 = range(9)
"""States of the attitude and its moments; the remembered commands follow."""
STATES, INPUTS = 9, 3
ANGLES, RATES = [PHI, THETA, PSI], [P, Q, R]
_SIZE = STATES + INPUTS
_MOMENTS = list(range(M1, M3 + 1))
_COMMANDS = list(range(STATES, _SIZE))
_SIGNS = (-1, 1)
MIRRORS = ((-1, -1, 1, 1, -1, -1, -1, 1, -1, -1, 1, -1), (1, 1, -1, -1, -1, -1, 1, -1, -1, 1, -1, -1))
"""Signs of the states under exchange of left and right, and of fore and aft."""

_HALF_A_TURN = 4  # half a turn or more, rad
_STARTS = (1.0, 1.0, 0.3, 10.0, 10.0, 5.0)  # phi, theta, psi, rad, to p, q, r, rad/s

Momentum: TypeAlias = Callable[[Array, Array], tuple[Array, Array]]
"""From moments and their rates, (flights, 3), to the rotors' momentum along body z and its rate, (flights,)."""


class CertifiedConditions(NamedTuple):
    """Disturbing moment, and used part of the battery's charge."""

    disturbance_n_m: float
    charge_part: float


class AttitudeNumbers(NamedTuple):
    """The numbers of a loop, as a certificate holds them."""

    interval_s: Any
    lag_s: Any
    stays: Any  # exp(-h / lag), to 16 digits
    inertia_kg_m2: Any
    commanded: Any  # c, (2, 3, 12): commanded and remembered moments
    unsure: Any  # bounds of their further dependence on each state, (2, 3, 12)
    angles: Any  # ranges, as in `of_error`
    rates_rad_s: Any
    momentum_n_m_s: Any  # range of the rotors' |h| along body z
    spin_s: Any  # κ Iz of rotors at one speed; `spin_spread_s` is its variation by each moment
    spin_spread_s: Any
    max_increment_n_m: Any
    from_moments: Any  # squared rotor speeds of moments, in units of the largest, (4, 3)
    to_moments: Any
    headroom: Any  # squared speed that the thrust leaves to moments, same units
    disturbance_n_m: Any  # largest |d|
    angle_weight: Any
    rate_weight: Any
    increment_weight: Any


def of_error(n: AttitudeNumbers) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Return vertices of T, largest |dT/dt| and limits of the angles, rad, of ε' = T ω with T = η + ½ [ε]×.

    ε is twice the vector part of the error quaternion, in body axes, with η = √(1 - ¼ ε²). `n.angles` are the ranges of
    |ε|, and the least η.
    """
    *ranges, least = n.angles
    x, y, z = ranges = np.array(ranges)
    if least <= 0 or 4 * least * least > 4 - x * x - y * y - z * z:
        raise RangeError("errors of the attitude are too large together")
    corners = np.array(list(product((-1, 1), repeat=3))) * ranges
    vertices = np.array([_of_quaternion(corner, eta) for corner in corners for eta in (least, 1)])
    change = abs(vertices).max(0) @ n.rates_rad_s / 2  # of ½ ε
    along = ranges @ n.rates_rad_s / 4
    dx, dy, dz = change
    return vertices, np.array([[along, dz, dy], [dz, along, dx], [dy, dx, along]]), ranges


def _of_quaternion(error: AnyArray, eta: Any) -> AnyArray:
    x, y, z = error
    return np.array([[eta, -z / 2, y / 2], [z / 2, eta, -x / 2], [-y / 2, x / 2, eta]])


class VertexBox(NamedTuple):
    """Vertices and largest entries; `beside` is the largest |T - 1|."""

    kinematic: AnyArray
    gyroscopic: AnyArray
    max_kinematic: AnyArray
    max_gyroscopic: AnyArray
    max_change: AnyArray
    beside: AnyArray
    max_angles: AnyArray


def attitude_loop(numbers: AttitudeNumbers, number: Number) -> UncertainLoop:
    n = AttitudeNumbers(*(_made(value, number) for value in numbers))
    box = box_of(n)
    eye: AnyArray = np.array([[number(float(i == j)) for j in range(_SIZE)] for i in range(_SIZE)])
    applied, _ = n.commanded
    change = applied - eye[_COMMANDS]
    gains, offsets = _remainders(n, box)
    weight = np.concatenate([n.angle_weight, n.rate_weight])
    return UncertainLoop(
        vertices=np.array([_transition(T, G, n, eye) for T in box.kinematic for G in box.gyroscopic]),
        entries=np.hstack([eye[:, ANGLES + RATES], _of_commands(n, eye), eye[:, _COMMANDS]]),
        channels=np.vstack([eye[RATES], eye[_MOMENTS], applied, eye[ANGLES], eye[_COMMANDS], applied - eye[_MOMENTS]]),
        gains=gains,
        offsets=offsets,
        disturbance=eye[:, RATES] * (n.interval_s * n.disturbance_n_m / n.inertia_kg_m2),
        limits=_limits(n, box, eye),
        starts=np.diag([number(start) for start in _STARTS]) @ eye[ANGLES + RATES],
        stage=(eye[:, ANGLES + RATES] * weight) @ eye[ANGLES + RATES] + (change.T * n.increment_weight) @ change,
        mirrors=np.array(MIRRORS),
    ).reduced()


def _made(value: Any, number: Number) -> Any:
    return np.array([_made(item, number) for item in value]) if isinstance(value, list) else number(value)


def box_of(n: AttitudeNumbers) -> VertexBox:
    kinematic, max_change, max_angles = of_error(n)
    p, q, r = n.rates_rad_s
    gyroscopic = np.array([_gyroscopic(n.inertia_kg_m2, a * p, b * q, c * r) for a, b, c in product(_SIGNS, repeat=3)])
    return VertexBox(
        kinematic,
        gyroscopic,
        abs(kinematic).max(0),
        abs(gyroscopic).max(0) + _rotors(n),
        max_change,
        abs(kinematic - np.eye(INPUTS, dtype=int)).max(0),
        max_angles,
    )


def _gyroscopic(inertia: AnyArray, p: Any, q: Any, r: Any) -> AnyArray:
    ix, iy, iz = inertia
    px, py, pz = (iy - iz) / (2 * ix), (iz - ix) / (2 * iy), (ix - iy) / (2 * iz)
    return np.array([[0, px * r, px * q], [py * r, 0, py * p], [pz * q, pz * p, 0]])


def _rotors(n: AttitudeNumbers) -> AnyArray:
    ix, iy, _ = n.momentum_n_m_s / n.inertia_kg_m2
    return np.array([[0, ix, 0], [iy, 0, 0], [0, 0, 0]])


def _kernels(n: AttitudeNumbers) -> tuple[Any, Any, Any, Any]:
    """Return the integrals over h of a decaying and of a commanded moment; then theirs."""
    h = n.interval_s
    begun = n.lag_s * (1 - n.stays)
    begun_twice = n.lag_s * (h - begun)
    return begun, h - begun, begun_twice, h * h / 2 - begun_twice


def _pushes(n: AttitudeNumbers, moments: AnyArray, commands: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Return the effect of moments and commands, rows (3, k), on rates over h, and on their integral."""
    b1, b2, c1, c2 = _kernels(n)
    once, twice = b1 * moments + b2 * commands, c1 * moments + c2 * commands
    spun, spun_once = (1 - n.stays) * (commands - moments), once - n.interval_s * moments
    once[2] += n.spin_s * spun[2]
    twice[2] += n.spin_s * spun_once[2]
    by_inertia = 1 / n.inertia_kg_m2[:, None]
    return once * by_inertia, twice * by_inertia


def _transition(T: AnyArray, G: AnyArray, n: AttitudeNumbers, eye: AnyArray) -> AnyArray:
    moments, (applied, remembered) = eye[_MOMENTS], n.commanded
    once, twice = _pushes(n, moments, applied)
    A = 0 * eye
    A[ANGLES] = eye[ANGLES] + T @ (n.interval_s * eye[RATES] + twice)
    A[RATES] = eye[RATES] + n.interval_s * (G @ eye[RATES]) + once
    A[_MOMENTS] = n.stays * moments + (1 - n.stays) * applied
    A[_COMMANDS] = remembered
    return A


def _of_commands(n: AttitudeNumbers, eye: AnyArray) -> AnyArray:
    one = eye[:INPUTS, :INPUTS]
    once, twice = _pushes(n, 0 * one, one)
    B = 0 * eye[:, :INPUTS]
    B[ANGLES], B[RATES], B[_MOMENTS] = twice, once, (1 - n.stays) * one
    return B


def _remainders(n: AttitudeNumbers, box: VertexBox) -> tuple[AnyArray, AnyArray]:
    """Return the bounds of ξ for each channel, (12, 18), and by the disturbance without its mean, (12,).

    Rates within the interval are at most W (|ω| + I⁻¹ (b1 |M| + b2 |u| + h d) + S |u - M|), W = (1 - h |G|)⁻¹
    (Gronwall).
    """
    h, T, G = n.interval_s, box.max_kinematic, box.max_gyroscopic
    b1, b2, c1, c2 = _kernels(n)
    one, by_inertia = np.eye(INPUTS, dtype=int), 1 / n.inertia_kg_m2
    within = h * h / 2 * (G @ _inverse(one - h * G))  # of ∫∫ |G ω|, for each of the largest rates
    turned, drifted = G @ within, T @ within
    twice = h / 2 * box.max_change
    spread = 0 * G
    spread[2] = (1 - n.stays) * n.spin_spread_s * by_inertia[2]
    spun = spread.copy()
    spun[2, 2] += (1 - n.stays) * abs(n.spin_s) * by_inertia[2]
    by_commands = np.vstack([(b2 * drifted + c2 * twice) * by_inertia, (b2 * turned + c2 * G) * by_inertia])
    by_changes = np.vstack([(drifted + h * twice) @ spun + h * (T @ spread), (turned + h * G) @ spun + spread])
    _, turning = _pushes(n, 0 * G, one + 0 * G)
    none = 0 * G
    beyond = (by_commands + by_changes + np.vstack([box.beside @ abs(turning), none])) @ n.unsure[0]
    of_states = np.vstack([beyond, *n.unsure])
    of_states[:6, RATES] += np.vstack([drifted, turned + h * _rotors(n)])
    of_states[:6, _MOMENTS] += np.vstack(
        [(b1 * drifted + c1 * twice) * by_inertia, (b1 * turned + c1 * G) * by_inertia]
    )
    of_rest = np.hstack([of_states[:, ANGLES], of_states[:, _COMMANDS]])
    gains = np.hstack(
        [
            of_states[:, RATES],
            of_states[:, _MOMENTS],
            np.vstack([by_commands, none, none]),
            of_rest,
            np.vstack([by_changes, none, none]),
        ]
    )
    pushed = by_inertia * n.disturbance_n_m
    on_angles = (h * drifted + h * h / 2 * T) @ pushed
    on_rates = (h * h / 2 * G + h * turned) @ pushed
    return gains, np.concatenate([on_angles, on_rates, 0 * on_angles, 0 * on_rates])


def _inverse(matrix: AnyArray) -> AnyArray:
    """Invert (3, 3) by cofactors; the result must be that of a Neumann series."""
    a, b, c = matrix
    cofactors = np.array([np.cross(b, c), np.cross(c, a), np.cross(a, b)]).T
    inverse: AnyArray = cofactors / (a @ cofactors[:, 0])
    if (inverse < 0).any():
        raise RangeError("the control interval is too long for these rates")
    return inverse


def _limits(n: AttitudeNumbers, box: VertexBox, eye: AnyArray) -> AnyArray:
    if n.headroom <= 0:
        raise RangeError("the thrust uses the full range of the rotors: no moments remain")
    h, rates = n.interval_s, n.rates_rad_s
    limited = len(box.max_angles)
    angles_left = box.max_angles - h * (box.max_kinematic @ rates)[:limited]
    rates_left = rates - _turns(n, box)
    rotors_left = [n.headroom - each for each in _unsure_speeds(n, box)]
    if min(*angles_left, *rates_left) <= 0:
        raise RangeError("the vehicle can leave these ranges of angles and rates within one control interval")
    if min(map(min, rotors_left)) <= 0:
        raise RangeError("the commands beyond the gain exceed the rotors")
    change = n.commanded[0] - eye[_COMMANDS]
    rows = [
        eye[ANGLES[:limited]] / angles_left[:, None],
        eye[RATES] / rates_left[:, None],
        change[: len(n.max_increment_n_m)] / n.max_increment_n_m[:, None],
        *(n.from_moments @ C / left[:, None] for C, left in zip(n.commanded, rotors_left, strict=True)),
        n.from_moments @ eye[_MOMENTS] / n.headroom,
    ]
    return np.array(list(dict.fromkeys(map(tuple, np.vstack(rows)))))


def _moments(n: AttitudeNumbers) -> AnyArray:
    largest: AnyArray = abs(n.to_moments).sum(axis=1) * n.headroom
    return largest


def _turns(n: AttitudeNumbers, box: VertexBox) -> AnyArray:
    moments = _moments(n)
    turns: AnyArray = (moments + n.disturbance_n_m) * n.interval_s
    turns[2] += (abs(n.spin_s) * moments[2] + n.spin_spread_s @ moments) * 2
    turns = turns / n.inertia_kg_m2 + n.interval_s * (box.max_gyroscopic @ n.rates_rad_s)
    return turns


def _unsure_speeds(n: AttitudeNumbers, box: VertexBox) -> AnyArray:
    largest = np.concatenate([n.rates_rad_s, _moments(n), _moments(n)])
    angles = np.concatenate([box.max_angles, [_HALF_A_TURN] * (INPUTS - len(box.max_angles))])
    beyond = n.unsure[:, :, RATES + _MOMENTS + _COMMANDS] @ largest + n.unsure[:, :, ANGLES] @ angles
    squared: AnyArray = beyond @ abs(n.from_moments).T
    return squared
