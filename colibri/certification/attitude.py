"""The attitude under the LQR of `lpv-mpc`, as an uncertain loop: exact kinematics, Euler's equation, the rotors' lag.

State, 12: errors of phi, p, theta, q, psi, r to a constant attitude, moments M1, M2, M3, and those last commanded. In
x' = A(rho) x + B u of `prediction` the columns of A that belong to angles are zero, so that the error to any constant
attitude obeys the same equation, with the angles themselves in rho. Nothing is linearised and nothing discretised: over
an interval h, with rho(t) anywhere in the box of its ranges,

    ω(h) = ω + h G ω + I⁻¹ (b1 M + b2 u) + ξ_ω          G: mean of the gyroscopic matrix, affine in p, q, r
    Φ(h) = Φ + T (h ω + I⁻¹ (c1 M + c2 u)) + ξ_Φ        T: mean of T(phi, theta) [2.7]

Means lie in convex hulls, and ξ, what is of second order in h or of the rotors' momentum, is bounded entry by entry. T
is the product of two points, (sin φ, cos φ) and (tan θ, 1 / cos θ), each on a curve that lies in a polygon: its chord,
and its tangents at both ends and in the middle. With the tangents of half the angles rational, so are all vertices.
"""

from itertools import product
from typing import Any, NamedTuple

import numpy as np

from colibri.autopilot.control.lpv_mpc.prediction import ANGLES, INPUTS, M1, M3, RATES, STATES
from colibri.certification.loop import AnyArray, Number, RangeError, UncertainLoop

_SIZE = STATES + INPUTS
_ANGLES, _RATES = list(ANGLES), list(RATES)
_MOMENTS = list(range(M1, M3 + 1))
_COMMANDS = list(range(STATES, _SIZE))
_SIGNS = (-1, 1)
_MIRRORS = (
    (-1, -1, 1, 1, -1, -1, -1, 1, -1, -1, 1, -1),
    (1, 1, -1, -1, -1, -1, 1, -1, -1, 1, -1, -1),
)
"""Left and right exchanged, and fore and aft: signs of the states. The rotors' momentum changes its sign, too."""


_STARTS = (1.0, 1.0, 0.3, 10.0, 10.0, 5.0)
"""phi, theta, psi, rad, to p, q, r, rad/s."""


class AttitudeNumbers(NamedTuple):
    """All that the loop is made of; the numbers that a certificate holds.

    Attributes:
        interval_s: h.
        lag_s: Of the moments; 0 where they follow at once.
        stays: exp(-h / lag), to 16 digits.
        inertia_kg_m2: (3,).
        gain: K of the law, (3, 12): the commands change by -K z.
        half_tangents: tan(phi / 2) and tan(theta / 2) at the ends of their ranges.
        rates_rad_s: Ranges of |p|, |q|, |r|.
        momentum_n_m_s: Range of the rotors' |h| along body z.
        max_increment_n_m: Largest changes of the commands in a sample, (3,).
        from_moments: Squared rotor speeds of moments, parts of the largest, (4, 3).
        to_moments: Moments of squared rotor speeds, N m, (3, 4).
        headroom: Squared speed that the thrust leaves to moments on either side, of every rotor, same parts.
        disturbance_n_m: Range of the length |d| of the moment that disturbs.
        output_weight, increment_weight: Diagonals of the law's Q and R, (3,) each.
    """

    interval_s: Any
    lag_s: Any
    stays: Any
    inertia_kg_m2: Any
    gain: Any
    half_tangents: Any
    rates_rad_s: Any
    momentum_n_m_s: Any
    max_increment_n_m: Any
    from_moments: Any
    to_moments: Any
    headroom: Any
    disturbance_n_m: Any
    output_weight: Any
    increment_weight: Any


class Box(NamedTuple):
    """What the ranges amount to.

    Attributes:
        kinematic, gyroscopic: Vertices of T, (16, 3, 3), and of G without the rotors, (8, 3, 3).
        max_kinematic, max_gyroscopic, max_change: Largest |T|, |G| and |dT/dt|, (3, 3) each.
        max_angles: Of phi and theta, rad, rounded down, (2,).
    """

    kinematic: AnyArray
    gyroscopic: AnyArray
    max_kinematic: AnyArray
    max_gyroscopic: AnyArray
    max_change: AnyArray
    max_angles: AnyArray


def attitude_loop(numbers: AttitudeNumbers, number: Number) -> UncertainLoop:
    """Return the loop in floats, or exactly in fractions."""
    n = AttitudeNumbers(*(_made(value, number) for value in numbers))
    box = box_of(n)
    eye: AnyArray = np.array([[number(float(i == j)) for j in range(_SIZE)] for i in range(_SIZE)])
    commanded = eye[_COMMANDS] - n.gain
    gains, offsets = _remainders(n, box)
    weight = eye[:, _ANGLES] * n.output_weight
    return UncertainLoop(
        vertices=np.array([_transition(T, G, n, eye) for T in box.kinematic for G in box.gyroscopic]),
        entries=eye[:, _ANGLES + _RATES],
        channels=np.vstack([eye[_RATES], eye[_MOMENTS], commanded]),
        gains=gains,
        offsets=offsets,
        disturbance=eye[:, _RATES] * (n.interval_s * n.disturbance_n_m / n.inertia_kg_m2),
        limits=_limits(n, box, eye),
        starts=np.diag([number(start) for start in _STARTS]) @ eye[_ANGLES + _RATES],
        stage=weight @ eye[_ANGLES] + (n.gain.T * n.increment_weight) @ n.gain,
        mirrors=np.array(_MIRRORS),
    ).reduced()


def _made(value: Any, number: Number) -> Any:
    return np.array([_made(item, number) for item in value]) if isinstance(value, list) else number(value)


def box_of(n: AttitudeNumbers) -> Box:
    """Return the vertices and bounds of the ranges in `n`, arrays of floats or of fractions."""
    (t, u), (p, q, r) = n.half_tangents, n.rates_rad_s
    sine, cosine = 2 * t / (1 + t * t), (1 - t * t) / (1 + t * t)
    tangent, secant = 2 * u / (1 - u * u), (1 + u * u) / (1 - u * u)
    roll = ((-sine, cosine), (-t, 1), (t, 1), (sine, cosine))
    pitch = ((-tangent, secant), (-u, 1), (u, 1), (tangent, secant))
    phi_rate, theta_rate = p + tangent * (sine * q + r), q + sine * r
    steep, slope = secant * secant * theta_rate, secant * tangent * theta_rate
    change = [  # of each entry of T, every factor at its largest
        [0, tangent * phi_rate + sine * steep, sine * tangent * phi_rate + steep],
        [0, sine * phi_rate, phi_rate],
        [0, secant * phi_rate + sine * slope, secant * sine * phi_rate + slope],
    ]
    kinematic = np.array([_kinematic(*x, *y) for x, y in product(roll, pitch)])
    gyroscopic = np.array([_gyroscopic(n.inertia_kg_m2, a * p, b * q, c * r) for a, b, c in product(_SIGNS, repeat=3)])
    angles = 2 * n.half_tangents - 2 * n.half_tangents**3 / 3  # the arcus tangent's series, whose next term is positive
    return Box(
        kinematic, gyroscopic, abs(kinematic).max(0), abs(gyroscopic).max(0) + _rotors(n), np.array(change), angles
    )


def _kinematic(sine: Any, cosine: Any, tangent: Any, secant: Any) -> AnyArray:
    return np.array([[1, sine * tangent, cosine * tangent], [0, cosine, -sine], [0, sine * secant, cosine * secant]])


def _gyroscopic(inertia: AnyArray, p: Any, q: Any, r: Any) -> AnyArray:
    """Return G of ω' = G ω, as `prediction.flow` has it, but for the rotors."""
    ix, iy, iz = inertia
    px, py, pz = (iy - iz) / (2 * ix), (iz - ix) / (2 * iy), (ix - iy) / (2 * iz)
    return np.array([[0, px * r, px * q], [py * r, 0, py * p], [pz * q, pz * p, 0]])


def _rotors(n: AttitudeNumbers) -> AnyArray:
    """Return the largest |entries| that the rotors' momentum adds to G: so small that it counts as a remainder."""
    ix, iy, _ = n.momentum_n_m_s / n.inertia_kg_m2
    return np.array([[0, ix, 0], [iy, 0, 0], [0, 0, 0]])


def _kernels(n: AttitudeNumbers) -> tuple[Any, Any, Any, Any]:
    """Return the integrals over h of a moment that begins at 1, and of one commanded to 1; then those of these."""
    h = n.interval_s
    begun = n.lag_s * (1 - n.stays)
    begun_twice = n.lag_s * (h - begun)
    return begun, h - begun, begun_twice, h * h / 2 - begun_twice


def _transition(T: AnyArray, G: AnyArray, n: AttitudeNumbers, eye: AnyArray) -> AnyArray:
    """Return A, (12, 12)."""
    b1, b2, c1, c2 = _kernels(n)
    moments, commanded = eye[_MOMENTS], eye[_COMMANDS] - n.gain
    by_inertia = 1 / n.inertia_kg_m2[:, None]
    A = 0 * eye
    A[_ANGLES] = eye[_ANGLES] + T @ (n.interval_s * eye[_RATES] + (c1 * moments + c2 * commanded) * by_inertia)
    A[_RATES] = eye[_RATES] + n.interval_s * (G @ eye[_RATES]) + (b1 * moments + b2 * commanded) * by_inertia
    A[_MOMENTS] = n.stays * moments + (1 - n.stays) * commanded
    A[_COMMANDS] = commanded
    return A


def _remainders(n: AttitudeNumbers, box: Box) -> tuple[AnyArray, AnyArray]:
    """Return the bounds of ξ: for each of |ω|, |M| and |u|, (6, 9), and by the disturbance but for its mean, (6,).

    The rates within the interval are at most W (|ω| + I⁻¹ (b1 |M| + b2 |u| + h d)), W = (1 - h |G|)⁻¹ (Gronwall), and
    |T(t) - T| is at most h / 2 times the largest change of T.
    """
    h, T, G = n.interval_s, box.max_kinematic, box.max_gyroscopic
    b1, b2, c1, c2 = _kernels(n)
    one, by_inertia = np.eye(INPUTS, dtype=int), 1 / n.inertia_kg_m2
    within = h * h / 2 * (G @ _inverse(one - h * G))  # of ∫∫ |G ω|, for each of the largest rates
    turned, drifted = G @ within, T @ within
    twice = h / 2 * box.max_change
    gains = np.block(
        [
            [drifted, (b1 * drifted + c1 * twice) * by_inertia, (b2 * drifted + c2 * twice) * by_inertia],
            [turned + h * _rotors(n), (b1 * turned + c1 * G) * by_inertia, (b2 * turned + c2 * G) * by_inertia],
        ]
    )
    pushed = by_inertia * n.disturbance_n_m
    on_angles = (h * drifted + h * h / 2 * T) @ pushed
    on_rates = (h * h / 2 * G + h * turned) @ pushed
    return gains, np.concatenate([on_angles, on_rates])


def _inverse(matrix: AnyArray) -> AnyArray:
    """Return the inverse of a matrix (3, 3) by its cofactors; it must be that of a Neumann series."""
    a, b, c = matrix
    cofactors = np.array([_cross(b, c), _cross(c, a), _cross(a, b)]).T
    inverse: AnyArray = cofactors / (a @ cofactors[:, 0])
    if (inverse < 0).any():
        raise RangeError("the control interval is too long for these rates")
    return inverse


def _cross(a: AnyArray, b: AnyArray) -> AnyArray:
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _limits(n: AttitudeNumbers, box: Box, eye: AnyArray) -> AnyArray:
    """Return the rows of angles, rates, increments and rotors.

    Angles and rates keep what they may move within an interval away from the ends of their ranges; a level attitude is
    held: what is left of the angles is what other ones may have.
    """
    if n.headroom <= 0:
        raise RangeError("the thrust leaves the rotors nothing for moments")
    h, rates = n.interval_s, n.rates_rad_s
    moments = abs(n.to_moments).sum(axis=1) * n.headroom
    turns = h * (box.max_gyroscopic @ rates + (moments + n.disturbance_n_m) / n.inertia_kg_m2)
    angles_left = box.max_angles - h * (box.max_kinematic @ rates)[:2]
    rates_left = rates - turns
    if (angles_left <= 0).any() or (rates_left <= 0).any():
        raise RangeError("a control interval is long enough to leave these ranges of angles and rates")
    return np.vstack(
        [
            eye[_ANGLES[:2]] / angles_left[:, None],
            eye[_RATES] / rates_left[:, None],
            n.gain / n.max_increment_n_m[:, None],
            n.from_moments @ (eye[_COMMANDS] - n.gain) / n.headroom,
            n.from_moments @ eye[_MOMENTS] / n.headroom,
        ]
    )
