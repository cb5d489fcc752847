"""Prediction step of the filter: Solà's sections 5.3 and 5.4, with the attitude error in the body frame."""

from math import sqrt
from typing import NamedTuple

import numpy as np

from colibri.common.compiled_rotations import quaternion_product, rotation_matrix
from colibri.common.jit import Packed, compiled
from colibri.common.kernels import cos, exp, sin
from colibri.common.matrices import put
from colibri.common.types import Array, Matrix, Quaternion, Vector

# First index of each part of the error state: m and m/s ENU, rad FLU, rad/s, m/s², m ENU, m, gauss FLU.
POSITION, VELOCITY, ATTITUDE, GYRO_BIAS, ACCEL_BIAS, GPS_DRIFT, BARO_OFFSET, HARD_IRON = 0, 3, 6, 9, 12, 15, 18, 19
ERRORS = 22
NOMINAL = 23  # the nominal state has a quaternion for the attitude: later parts are one place later

INTERVAL, FORCE, RATE, BLIND_FORCE, BLIND_RATE = 0, 1, 4, 7, 8
SAMPLE = 9  # columns of a sample: duration, s; mean specific force and rate; whether each is unknown or modelled
ACROSS, ALONG, THRUST = 1, 2, 3  # of a modelled force: drag across and along the rotors' axes, over hover's across
UNKNOWN, MODELLED = 1.0, 2.0  # with velocity or attitude constant; replaced by the model of the rotors

_BLIND_FORCE_DENSITY = 3.0**2  # (m/s²)²/Hz: 3 m/s after a second without an accelerometer
_BLIND_RATE_DENSITY = 0.5**2  # (rad/s)²/Hz
_MODELLED_FORCE_DENSITY, _MODELLED_FORCE_WALK = 0.3**2, 0.5**2  # (m/s²)²/Hz, (m/s³)²/Hz: by drag and ground
_MODELLED_RATE_DENSITY, _MODELLED_RATE_WALK = 0.03**2, 0.3**2  # (rad/s)²/Hz, (rad/s²)²/Hz: unknown moments
_SMALL_TURN = 0.05  # half turn, rad, below which the series of sine and cosine are exact to the last bits
# Beyond these variances a part is unknown and loses its correlations, so that P stays positive.
_MAX_POSITION_VARIANCE, _MAX_VELOCITY_VARIANCE, _MAX_ATTITUDE_VARIANCE = 1e6, 1e4, 1.0


class Noise(NamedTuple):
    """Process noise as spectral densities of white noise.

    Attributes:
        force, rate: (m/s²)²/Hz and (rad/s)²/Hz.
        gyro_bias, accel_bias: Of the walks, (rad/s²)²/Hz and (m/s³)²/Hz.
        baro_offset, hard_iron: Of the walks, m²/s and gauss²/s.
    """

    force: float
    rate: float
    gyro_bias: float
    accel_bias: float
    gps_drift: tuple[float, float, float]  # variances of the Gauss-Markov drift, m², ENU
    gps_drift_time_s: float
    baro_offset: float
    hard_iron: float


@compiled
def strap_down(x: Array, samples: Array, row: int, gravity: float) -> tuple[Matrix, Vector, Vector]:
    """Advance the nominal state by one sample, Solà's (260).

    Return the rotation at mid-interval by rows, specific force without bias, and the angle turned, rad, FLU.
    """
    dt = samples[row, INTERVAL]
    a, b, c = 0.0, 0.0, 0.0
    if samples[row, BLIND_RATE] != UNKNOWN:
        a = (samples[row, RATE] - x[10]) * dt
        b = (samples[row, RATE + 1] - x[11]) * dt
        c = (samples[row, RATE + 2] - x[12]) * dt
    q = (x[6], x[7], x[8], x[9])
    R = rotation_matrix(_turned(q, 0.5 * a, 0.5 * b, 0.5 * c))
    fx, fy, fz = R[2][0] * gravity, R[2][1] * gravity, R[2][2] * gravity
    if samples[row, BLIND_FORCE] == MODELLED:
        fx, fy, fz = 0.0, 0.0, samples[row, THRUST]
        M = _drag_matrix(R, samples, row)
        for axis in range(3):
            x[3 + axis] -= (M[axis, 0] * x[13] + M[axis, 1] * x[14] + M[axis, 2] * x[15]) * dt
    elif samples[row, BLIND_FORCE] != UNKNOWN:
        fx = samples[row, FORCE] - x[13]
        fy = samples[row, FORCE + 1] - x[14]
        fz = samples[row, FORCE + 2] - x[15]
    dvx = (R[0][0] * fx + R[0][1] * fy + R[0][2] * fz) * dt
    dvy = (R[1][0] * fx + R[1][1] * fy + R[1][2] * fz) * dt
    dvz = (R[2][0] * fx + R[2][1] * fy + R[2][2] * fz - gravity) * dt
    x[0] += (x[3] + 0.5 * dvx) * dt
    x[1] += (x[4] + 0.5 * dvy) * dt
    x[2] += (x[5] + 0.5 * dvz) * dt
    x[3] += dvx
    x[4] += dvy
    x[5] += dvz
    w, i, j, k = _turned(q, a, b, c)
    scale = 1.0 / sqrt(w * w + i * i + j * j + k * k)
    x[6], x[7], x[8], x[9] = w * scale, i * scale, j * scale, k * scale
    return R, (fx, fy, fz), (a, b, c)


@compiled
def _drag_matrix(R: Matrix, samples: Array, row: int) -> Array:
    """Return the effect of the bias of a modelled force, ENU: horizontal drag in level hover, and vertical force."""
    across, along = samples[row, ACROSS], samples[row, ALONG]
    M = np.zeros((3, 3))
    for j in range(2):
        for i in range(3):
            M[i, j] = (along - across) * R[i][2] * R[j][2]
        M[j, j] += across
    M[2, 2] = 1.0
    return M


@compiled
def predict(x: Array, P: Array, samples: Array, row: int, packed: Packed, gravity: float) -> None:
    """Advance state and covariance in place: P = F P Fᵀ + Q, Solà's (270) and (271)."""
    noise, dt = packed[0], samples[row, INTERVAL]
    sees_force, sees_rate = samples[row, BLIND_FORCE] != UNKNOWN, samples[row, BLIND_RATE] != UNKNOWN
    R, force, turn = strap_down(x, samples, row, gravity)
    decay = exp(-dt / noise.gps_drift_time_s)
    F = np.zeros((9, 3))
    push, lever, back = F[:3], F[3:6], F[6:]
    if sees_force:
        fx, fy, fz = force[0] * dt, force[1] * dt, force[2] * dt
        for i in range(3):
            a, b, c = R[i]
            push[i, 0], push[i, 1], push[i, 2] = c * fy - b * fz, a * fz - c * fx, b * fx - a * fy
            lever[i, 0], lever[i, 1], lever[i, 2] = a * dt, b * dt, c * dt
    if samples[row, BLIND_FORCE] == MODELLED:
        put(_drag_matrix(R, samples, row) * dt, lever)
    unturned = rotation_matrix(_turned((1.0, 0.0, 0.0, 0.0), -0.5 * turn[0], -0.5 * turn[1], -0.5 * turn[2]))
    for i in range(3):
        back[i, 0], back[i, 1], back[i, 2] = unturned[i]
    half_s = 0.5 * dt if sees_rate else 0.0
    _carry(P, push, lever, back, half_s, decay, dt)
    _carry(P.T, push, lever, back, half_s, decay, dt)
    force_noise = noise.force if sees_force else _BLIND_FORCE_DENSITY
    force_walk = noise.accel_bias
    if samples[row, BLIND_FORCE] == MODELLED:
        force_noise, force_walk = _MODELLED_FORCE_DENSITY, _MODELLED_FORCE_WALK
    rate_noise = noise.rate if sees_rate else _BLIND_RATE_DENSITY
    rate_walk = noise.gyro_bias
    if samples[row, BLIND_RATE] == MODELLED:
        rate_noise, rate_walk = _MODELLED_RATE_DENSITY, _MODELLED_RATE_WALK
    for i in range(3):
        x[16 + i] *= decay
        P[VELOCITY + i, VELOCITY + i] += force_noise * dt
        P[ATTITUDE + i, ATTITUDE + i] += rate_noise * dt
        P[GYRO_BIAS + i, GYRO_BIAS + i] += rate_walk * dt
        P[ACCEL_BIAS + i, ACCEL_BIAS + i] += force_walk * dt
        P[GPS_DRIFT + i, GPS_DRIFT + i] += noise.gps_drift[i] * (1.0 - decay * decay)
        P[HARD_IRON + i, HARD_IRON + i] += noise.hard_iron * dt
    P[BARO_OFFSET, BARO_OFFSET] += noise.baro_offset * dt
    _bound(P, POSITION, _MAX_POSITION_VARIANCE)
    _bound(P, VELOCITY, _MAX_VELOCITY_VARIANCE)
    _bound(P, ATTITUDE, _MAX_ATTITUDE_VARIANCE)


@compiled
def look_ahead(x: Array, P: Array, samples: Array, first: int, count: int, gravity: float, now: Array) -> None:
    """Write the state and its standard deviations after `count` samples from row `first` of the ring to `now`, (19,).

    Position, velocity, attitude (10,); then deviations of position, velocity, and attitude about ENU axes (9,).
    """
    ahead = x.copy()
    delay, row = 0.0, first
    for _ in range(count):
        delay += samples[row, INTERVAL]
        strap_down(ahead, samples, row, gravity)
        row += 1
        if row == len(samples):
            row = 0
    put(ahead, now[:10])
    R = rotation_matrix((x[6], x[7], x[8], x[9]))
    for i in range(3):
        p, v = POSITION + i, VELOCITY + i
        now[10 + i] = sqrt(P[p, p] + delay * (2.0 * P[p, v] + delay * P[v, v]))
        now[13 + i] = sqrt(P[v, v])
        variance = 0.0
        for j in range(3):
            for k in range(3):
                variance += R[i][j] * P[ATTITUDE + j, ATTITUDE + k] * R[i][k]
        now[16 + i] = sqrt(variance)


@compiled
def _carry(P: Array, push: Array, lever: Array, back: Array, half_s: float, decay: float, dt: float) -> None:
    for column in range(ERRORS):
        g0, g1, g2 = half_s * P[9, column], half_s * P[10, column], half_s * P[11, column]
        t0, t1, t2 = P[6, column], P[7, column], P[8, column]
        a0 = back[0, 0] * t0 + back[0, 1] * t1 + back[0, 2] * t2 - g0
        a1 = back[1, 0] * t0 + back[1, 1] * t1 + back[1, 2] * t2 - g1
        a2 = back[2, 0] * t0 + back[2, 1] * t1 + back[2, 2] * t2 - g2
        b0, b1, b2 = P[12, column], P[13, column], P[14, column]
        for i in range(3):
            v = P[3 + i, column]
            after = v + (push[i, 0] * a0 + push[i, 1] * a1 + push[i, 2] * a2)
            after -= lever[i, 0] * b0 + lever[i, 1] * b1 + lever[i, 2] * b2
            P[i, column] += 0.5 * dt * (v + after)
            P[3 + i, column] = after
            P[15 + i, column] *= decay
        a0, a1, a2 = a0 - g0, a1 - g1, a2 - g2
        P[6, column] = back[0, 0] * a0 + back[0, 1] * a1 + back[0, 2] * a2
        P[7, column] = back[1, 0] * a0 + back[1, 1] * a1 + back[1, 2] * a2
        P[8, column] = back[2, 0] * a0 + back[2, 1] * a1 + back[2, 2] * a2


@compiled
def _bound(P: Array, part: int, maximum: float) -> None:
    for i in range(part, part + 3):
        if P[i, i] > maximum:
            P[i, :] = 0.0
            P[:, i] = 0.0
            P[i, i] = maximum


@compiled
def _turned(q: Quaternion, x: float, y: float, z: float) -> Quaternion:
    """Return q ⊗ Exp of a body rotation vector, rad."""
    square = 0.25 * (x * x + y * y + z * z)
    if square < _SMALL_TURN * _SMALL_TURN:
        c = 1.0 - square * (0.5 - square / 24.0)
        s = 0.5 * (1.0 - square * (1.0 / 6.0 - square / 120.0))
    else:
        half = sqrt(square)
        c, s = cos(half), 0.5 * sin(half) / half
    return quaternion_product(q, (c, s * x, s * y, s * z))
