"""Error-state Kalman filter: how state and covariance go on with what gyroscope and accelerometer measure.

J. Solà, Quaternion kinematics for the error-state Kalman filter, arXiv:1711.02508, sections 5.3 and 5.4, in ENU/FLU:
the attitude rotates body vectors into the earth frame, and its error is a small rotation in the body frame.
"""

from math import cos, sin, sqrt
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mavlink.compiled import compiled

Array: TypeAlias = NDArray[np.float64]

POSITION, VELOCITY, ATTITUDE, GYRO_BIAS, ACCEL_BIAS, GPS_DRIFT, BARO_OFFSET, HARD_IRON = 0, 3, 6, 9, 12, 15, 18, 19
"""Where the parts of the error state begin: m and m/s ENU, rad FLU, rad/s, m/s², m ENU, m, gauss FLU."""
ERRORS = 22
NOMINAL = 23
"""The nominal state is the same with a quaternion for the attitude: what follows it lies one place later."""

INTERVAL, FORCE, RATE, BLIND_FORCE, BLIND_RATE = 0, 1, 4, 7, 8
SAMPLE = 9
"""Of the interval from one frame to the next: its length, s; mean specific force and rate as measured; and whether
either is not known (1.0): then the vehicle is taken to keep its velocity, or its attitude."""

_BLIND_FORCE_DENSITY = 3.0**2
"""(m/s²)²/Hz: 3 m/s after a second without an accelerometer."""
_BLIND_RATE_DENSITY = 0.5**2
"""(rad/s)²/Hz."""
_SMALL_TURN = 0.05
"""Half a turn, rad, below which the series of sine and cosine are exact to the last bits."""
_MOST_POSITION, _MOST_VELOCITY, _MOST_ATTITUDE = 1e6, 1e4, 1.0
"""Variances beyond which a part is unknown: it forgets what it had to do with the others, and all stays positive."""


class Noise(NamedTuple):
    """What drives the errors: spectral densities of white noise.

    Attributes:
        force: Of the specific force, (m/s²)²/Hz.
        rate: Of the rates, (rad/s)²/Hz.
        gyro_bias: Of the walk of the gyroscope's bias, (rad/s²)²/Hz.
        accel_bias: Of the walk of the accelerometer's bias, (m/s³)²/Hz.
        gps_drift: Variances of the Gauss-Markov drift of GPS, m², east, north, up.
        gps_drift_time_s: Its correlation time.
        baro_offset: Of the walk of the barometer's offset, m²/s.
        hard_iron: Of the walk of the vehicle's own field, gauss²/s.
    """

    force: float
    rate: float
    gyro_bias: float
    accel_bias: float
    gps_drift: tuple[float, float, float]
    gps_drift_time_s: float
    baro_offset: float
    hard_iron: float


@compiled
def strap_down(x: Array, sample: Array, gravity: float) -> tuple[Array, Array]:
    """Move the nominal state on by one sample, Solà's (260) with the attitude at the middle of the interval.

    Returns:
        The rotation at the middle, (3, 3); specific force without its bias, FLU, and the angle turned, rad FLU, (6,).
    """
    dt = sample[INTERVAL]
    motion = np.zeros(6)
    if sample[BLIND_RATE] == 0.0:
        for i in range(3):
            motion[3 + i] = (sample[RATE + i] - x[10 + i]) * dt
    q = x[6:10]
    middle = _turned(q, 0.5 * motion[3], 0.5 * motion[4], 0.5 * motion[5])
    R = _matrix(middle)
    if sample[BLIND_FORCE] == 0.0:
        for i in range(3):
            motion[i] = sample[FORCE + i] - x[13 + i]
    else:
        for i in range(3):
            motion[i] = R[2, i] * gravity
    for i in range(3):
        a = R[i, 0] * motion[0] + R[i, 1] * motion[1] + R[i, 2] * motion[2] - (gravity if i == 2 else 0.0)
        x[i] += (x[3 + i] + 0.5 * a * dt) * dt
        x[3 + i] += a * dt
    after = _turned(q, motion[3], motion[4], motion[5])
    scale = 1.0 / sqrt(after[0] ** 2 + after[1] ** 2 + after[2] ** 2 + after[3] ** 2)
    for i in range(4):
        x[6 + i] = after[i] * scale
    return R, motion


@compiled
def predict(x: Array, P: Array, sample: Array, noise: Noise, gravity: float) -> None:
    """Move state (23,) and covariance (22, 22) on by one sample, in place: P = F P Fᵀ + Q, Solà's (270) and (271)."""
    dt = sample[INTERVAL]
    R, motion = strap_down(x, sample, gravity)
    decay = np.exp(-dt / noise.gps_drift_time_s)
    fx, fy, fz = motion[0] * dt, motion[1] * dt, motion[2] * dt
    push = np.empty((3, 3))
    for i in range(3):
        push[i, 0] = -(R[i, 1] * fz - R[i, 2] * fy)
        push[i, 1] = -(R[i, 2] * fx - R[i, 0] * fz)
        push[i, 2] = -(R[i, 0] * fy - R[i, 1] * fx)
    back = _matrix(_turned(np.array([1.0, 0.0, 0.0, 0.0]), -motion[3], -motion[4], -motion[5]))
    lever = R * dt
    if sample[BLIND_FORCE] != 0.0:
        push[:] = 0.0
        lever[:] = 0.0
    bias = dt if sample[BLIND_RATE] == 0.0 else 0.0
    _carry(P, push, lever, back, bias, decay, dt)
    _carry(P.T, push, lever, back, bias, decay, dt)
    force = noise.force if sample[BLIND_FORCE] == 0.0 else _BLIND_FORCE_DENSITY
    rate = noise.rate if sample[BLIND_RATE] == 0.0 else _BLIND_RATE_DENSITY
    for i in range(3):
        x[16 + i] *= decay
        P[VELOCITY + i, VELOCITY + i] += force * dt
        P[ATTITUDE + i, ATTITUDE + i] += rate * dt
        P[GYRO_BIAS + i, GYRO_BIAS + i] += noise.gyro_bias * dt
        P[ACCEL_BIAS + i, ACCEL_BIAS + i] += noise.accel_bias * dt
        P[GPS_DRIFT + i, GPS_DRIFT + i] += noise.gps_drift[i] * (1.0 - decay * decay)
        P[HARD_IRON + i, HARD_IRON + i] += noise.hard_iron * dt
    P[BARO_OFFSET, BARO_OFFSET] += noise.baro_offset * dt
    _bound(P, POSITION, _MOST_POSITION)
    _bound(P, VELOCITY, _MOST_VELOCITY)
    _bound(P, ATTITUDE, _MOST_ATTITUDE)


@compiled
def look_ahead(x: Array, P: Array, samples: Array, first: int, count: int, gravity: float, now: Array) -> None:
    """Write the state that `count` samples after the filter's lead to, and how well it is known.

    Args:
        x: Nominal state of the filter, (23,).
        P: Its covariance.
        samples: A ring of samples, (n, 9).
        first: The one that follows the filter's state.
        count: How many.
        gravity: m/s².
        now: Position, velocity, attitude (10,); standard deviations of position, of velocity (ENU), and of attitude
            about east, north and up, rad (9,).
    """
    ahead = x.copy()
    delay = 0.0
    for i in range(count):
        sample = samples[(first + i) % len(samples)]
        delay += sample[INTERVAL]
        strap_down(ahead, sample, gravity)
    now[:10] = ahead[:10]
    R = _matrix(x[6:10])
    for i in range(3):
        p, v = POSITION + i, VELOCITY + i
        now[10 + i] = sqrt(P[p, p] + delay * (2.0 * P[p, v] + delay * P[v, v]))
        now[13 + i] = sqrt(P[v, v])
        variance = 0.0
        for j in range(3):
            for k in range(3):
                variance += R[i, j] * P[ATTITUDE + j, ATTITUDE + k] * R[i, k]
        now[16 + i] = sqrt(variance)


@compiled
def _carry(P: Array, push: Array, lever: Array, back: Array, bias: float, decay: float, dt: float) -> None:
    """Multiply P by the transition matrix from the left, row by row."""
    for column in range(ERRORS):
        a0, a1, a2 = P[6, column], P[7, column], P[8, column]
        b0, b1, b2 = P[12, column], P[13, column], P[14, column]
        for i in range(3):
            v = P[3 + i, column]
            after = v + (push[i, 0] * a0 + push[i, 1] * a1 + push[i, 2] * a2)
            after -= lever[i, 0] * b0 + lever[i, 1] * b1 + lever[i, 2] * b2
            P[i, column] += 0.5 * dt * (v + after)
            P[3 + i, column] = after
        for i in range(3):
            P[6 + i, column] = back[i, 0] * a0 + back[i, 1] * a1 + back[i, 2] * a2 - bias * P[9 + i, column]
            P[15 + i, column] *= decay


@compiled
def _bound(P: Array, part: int, most: float) -> None:
    for i in range(part, part + 3):
        if P[i, i] > most:
            P[i, :] = 0.0
            P[:, i] = 0.0
            P[i, i] = most


@compiled
def _turned(q: Array, x: float, y: float, z: float) -> Array:
    """Return the quaternion turned by a rotation vector in the body frame, rad: q ⊗ Exp."""
    half = 0.5 * sqrt(x * x + y * y + z * z)
    if half < _SMALL_TURN:
        square = half * half
        c = 1.0 - square * (0.5 - square / 24.0)
        s = 0.5 * (1.0 - square * (1.0 / 6.0 - square / 120.0))
    else:
        c, s = cos(half), 0.5 * sin(half) / half
    x, y, z = s * x, s * y, s * z
    turned = np.empty(4)
    turned[0] = q[0] * c - q[1] * x - q[2] * y - q[3] * z
    turned[1] = q[0] * x + q[1] * c + q[2] * z - q[3] * y
    turned[2] = q[0] * y - q[1] * z + q[2] * c + q[3] * x
    turned[3] = q[0] * z + q[1] * y - q[2] * x + q[3] * c
    return turned


@compiled
def _matrix(q: Array) -> Array:
    w, x, y, z = q
    R = np.empty((3, 3))
    R[0, 0], R[0, 1], R[0, 2] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
    return R
