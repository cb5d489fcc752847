"""Update step of the filter: Solà's (275), Joseph form, injection (283) and reset (287).

Every `fuse_…` corrects x (23,) and P (22, 22) in place, writes the innovation y, and returns NIS = yᵀ S⁻¹ y. If NIS
exceeds the gate or is nan, only y is written.
"""

from math import inf, sqrt

import numpy as np

from colibri.autopilot.estimation.eskf_predict import (
    ACCEL_BIAS,
    ATTITUDE,
    BARO_OFFSET,
    ERRORS,
    GPS_DRIFT,
    HARD_IRON,
    POSITION,
    VELOCITY,
)
from colibri.common.compiled_rotations import rotation_matrix
from colibri.common.jit import compiled
from colibri.common.kernels import asin
from colibri.common.types import Array

_MIN_VARIANCE = 1e-18  # rounding floor of a variance


@compiled
def fuse_horizontal(x: Array, P: Array, place: Array, after_s: float, variance: float, gate: float, y: Array) -> float:
    """Fuse east and north, m, of a fix `after_s` after the state."""
    H = np.zeros((2, ERRORS))
    for i in range(2):
        H[i, POSITION + i], H[i, GPS_DRIFT + i], H[i, VELOCITY + i] = 1.0, 1.0, after_s
        y[i] = place[i] - (x[i] + after_s * x[3 + i] + x[16 + i])
    return fuse_rows(x, P, H, y, variance, gate)


@compiled
def fuse_height(x: Array, P: Array, place: Array, after_s: float, variance: float, gate: float, y: Array) -> float:
    H = np.zeros((1, ERRORS))
    H[0, POSITION + 2], H[0, GPS_DRIFT + 2], H[0, VELOCITY + 2] = 1.0, 1.0, after_s
    y[0] = place[2] - (x[2] + after_s * x[5] + x[18])
    return fuse_rows(x, P, H, y, variance, gate)


@compiled
def fuse_velocity(x: Array, P: Array, velocity: Array, variance: float, gate: float, y: Array) -> float:
    """Fuse a velocity, m/s ENU."""
    H = np.zeros((3, ERRORS))
    for i in range(3):
        H[i, VELOCITY + i] = 1.0
        y[i] = velocity[i] - x[3 + i]
    return fuse_rows(x, P, H, y, variance, gate)


@compiled
def fuse_fix(
    x: Array, P: Array, fix: Array, after_s: float, variances: Array, gates: Array, y: Array, nis: Array
) -> None:
    """Fuse velocity, place, height of a fix in turn, outputs in this order; `fix` (6,) is place and velocity, ENU."""
    nis[0] = fuse_velocity(x, P, fix[3:], variances[0], gates[0], y[:3])
    nis[1] = fuse_horizontal(x, P, fix[:3], after_s, variances[1], gates[1], y[3:5])
    nis[2] = fuse_height(x, P, fix[:3], after_s, variances[2], gates[2], y[5:])


@compiled
def fuse_pressure_height(x: Array, P: Array, height: float, variance: float, gate: float, y: Array) -> float:
    H = np.zeros((1, ERRORS))
    H[0, POSITION + 2], H[0, BARO_OFFSET] = 1.0, 1.0
    y[0] = height - (x[2] + x[19])
    return fuse_rows(x, P, H, y, variance, gate)


@compiled
def fuse_field(x: Array, P: Array, measured: Array, field: Array, variance: float, gate: float, y: Array) -> float:
    """Fuse a magnetic field, gauss FLU, with the earth's `field`, gauss ENU."""
    H = np.zeros((3, ERRORS))
    body = _in_body(x, field)
    _put_cross(H, body)
    for i in range(3):
        H[i, HARD_IRON + i] = 1.0
        y[i] = measured[i] - (body[i] + x[20 + i])
    return fuse_rows(x, P, H, y, variance, gate)


@compiled
def fuse_rest(
    x: Array,
    P: Array,
    force: Array,
    gravity: float,
    force_variance: float,
    measured: Array,
    field: Array,
    field_variance: float,
    y: Array,
) -> float:
    """Fuse specific force, m/s², and magnetic field, gauss, FLU, at rest jointly; y (6,) is in sigmas."""
    H = np.zeros((6, ERRORS))
    up = _in_body(x, np.array([0.0, 0.0, gravity]))
    body = _in_body(x, field)
    _put_cross(H[:3], up)
    _put_cross(H[3:], body)
    for i in range(3):
        H[i, ACCEL_BIAS + i], H[3 + i, HARD_IRON + i] = 1.0, 1.0
        y[i] = (force[i] - (up[i] + x[13 + i])) / sqrt(force_variance)
        y[3 + i] = (measured[i] - (body[i] + x[20 + i])) / sqrt(field_variance)
        for j in range(ERRORS):
            H[i, j] /= sqrt(force_variance)
            H[3 + i, j] /= sqrt(field_variance)
    return fuse_rows(x, P, H, y, 1.0, inf)


@compiled
def inflate_covariance(P: Array, first: int, count: int, variance: float) -> None:
    """Inflate variances, so that the next measurement is accepted."""
    for i in range(first, first + count):
        P[i, i] += variance


@compiled
def is_of_earth(x: Array, measured: Array, field: Array, strength_part: float, dip_rad: float) -> bool:
    """Check a magnetic field, gauss FLU, minus the vehicle's own, for strength and dip of the earth's, ENU."""
    up = _in_body(x, np.array([0.0, 0.0, 1.0]))
    own, earth, along = 0.0, 0.0, 0.0
    for i in range(3):
        axis = measured[i] - x[20 + i]
        own += axis * axis
        earth += field[i] * field[i]
        along += axis * up[i]
    own, earth = sqrt(own), sqrt(earth)
    if not abs(own - earth) <= strength_part * earth:
        return False
    return abs(asin(min(max(along / own, -1.0), 1.0)) - asin(field[2] / earth)) <= dip_rad


@compiled
def fuse_rows(x: Array, P: Array, H: Array, y: Array, variance: float, gate: float) -> float:
    """Fuse linearised measurements H (m, 22) of equal variance."""
    m = len(H)
    C = np.zeros((ERRORS, m))
    for k in range(m):
        for j in range(ERRORS):
            h = H[k, j]
            if h != 0.0:
                for i in range(ERRORS):
                    C[i, k] += P[i, j] * h
    S = np.zeros((m, m))
    for k in range(m):
        for other in range(m):
            for j in range(ERRORS):
                S[k, other] += H[k, j] * C[j, other]
        S[k, k] += variance
    L = _cholesky(S)
    w = np.empty(m)
    nis = 0.0
    for k in range(m):
        w[k] = y[k]
        for j in range(k):
            w[k] -= L[k, j] * w[j]
        w[k] /= L[k, k]
        nis += w[k] * w[k]
    if not nis <= gate:
        return nis if nis > gate else inf
    K = _gain(C, L)
    error = np.zeros(ERRORS)
    for i in range(ERRORS):
        for k in range(m):
            error[i] += K[i, k] * y[k]
    _join(P, C, K, S)
    _inject(x, P, error)
    return nis


@compiled
def _cholesky(S: Array) -> Array:
    m = len(S)
    L = np.zeros((m, m))
    for i in range(m):
        for j in range(i + 1):
            rest = S[i, j]
            for k in range(j):
                rest -= L[i, k] * L[j, k]
            L[i, j] = sqrt(rest) if i == j else rest / L[j, j]
    return L


@compiled
def _gain(C: Array, L: Array) -> Array:
    m = len(L)
    K = C.copy()
    for i in range(len(C)):
        for k in range(m):
            for j in range(k):
                K[i, k] -= K[i, j] * L[k, j]
            K[i, k] /= L[k, k]
        for k in range(m - 1, -1, -1):
            for j in range(k + 1, m):
                K[i, k] -= K[i, j] * L[j, k]
            K[i, k] /= L[k, k]
    return K


@compiled
def _join(P: Array, C: Array, K: Array, S: Array) -> None:
    """P = (I - K H) P (I - K H)ᵀ + K R Kᵀ, with C = P Hᵀ multiplied out."""
    m = len(S)
    for i in range(ERRORS):
        for j in range(i + 1):
            change = 0.0
            for k in range(m):
                change -= K[i, k] * C[j, k] + C[i, k] * K[j, k]
                for other in range(m):
                    change += K[i, k] * S[k, other] * K[j, other]
            P[i, j] = 0.5 * (P[i, j] + P[j, i]) + change
            P[j, i] = P[i, j]
        P[i, i] = max(P[i, i], _MIN_VARIANCE)


@compiled
def _inject(x: Array, P: Array, error: Array) -> None:
    for i in range(ATTITUDE):
        x[i] += error[i]
    for i in range(ATTITUDE + 3, ERRORS):
        x[1 + i] += error[i]
    a, b, c = 0.5 * error[6], 0.5 * error[7], 0.5 * error[8]
    w, q1, q2, q3 = x[6], x[7], x[8], x[9]
    x[6] = w - q1 * a - q2 * b - q3 * c
    x[7] = q1 + w * a + q2 * c - q3 * b
    x[8] = q2 + w * b + q3 * a - q1 * c
    x[9] = q3 + w * c + q1 * b - q2 * a
    size = sqrt(x[6] ** 2 + x[7] ** 2 + x[8] ** 2 + x[9] ** 2)
    for i in range(6, 10):
        x[i] /= size
    for j in range(ERRORS):
        p, q, r = P[6, j], P[7, j], P[8, j]
        P[6, j], P[7, j], P[8, j] = p + c * q - b * r, q - c * p + a * r, r + b * p - a * q
    for i in range(ERRORS):
        p, q, r = P[i, 6], P[i, 7], P[i, 8]
        P[i, 6], P[i, 7], P[i, 8] = p + c * q - b * r, q - c * p + a * r, r + b * p - a * q


@compiled
def _in_body(x: Array, earth: Array) -> Array:
    R, body = rotation_matrix((x[6], x[7], x[8], x[9])), np.empty(3)
    for i in range(3):
        body[i] = R[0][i] * earth[0] + R[1][i] * earth[1] + R[2][i] * earth[2]
    return body


@compiled
def _put_cross(H: Array, body: Array) -> None:
    """Write [body]×, the derivative with the attitude error."""
    x, y, z = body
    H[0, ATTITUDE + 1], H[0, ATTITUDE + 2] = -z, y
    H[1, ATTITUDE], H[1, ATTITUDE + 2] = z, -x
    H[2, ATTITUDE], H[2, ATTITUDE + 1] = -y, x
