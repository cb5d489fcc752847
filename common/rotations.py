"""Rotations between body (FLU) and earth (ENU).

Vectors and quaternions are tuples, faster than arrays at these sizes. Quaternions are wxyz, Hamilton, and rotate body
vectors into the earth frame. Euler angles are Z-Y'-X'': yaw psi, pitch theta, roll phi.
"""

from math import degrees, floor, pi, sqrt

from colibri.common.elementary import acos, asin, atan2, cos, sin
from colibri.common.types import Matrix, Quaternion, Vector


def normalized(q: Quaternion) -> Quaternion:
    w, x, y, z = q
    norm = sqrt(w * w + x * x + y * y + z * z)
    if norm == 0.0:
        raise ValueError("a zero quaternion is no rotation")
    return (w / norm, x / norm, y / norm, z / norm)


def quaternion_product(a: Quaternion, b: Quaternion) -> Quaternion:
    (w, x, y, z), (v, i, j, k) = a, b
    return (
        w * v - x * i - y * j - z * k,
        w * i + x * v + y * k - z * j,
        w * j - x * k + y * v + z * i,
        w * k + x * j - y * i + z * v,
    )


def rotation_matrix(q: Quaternion) -> Matrix:
    """Return R of THESIS [2.6], rows first: earth = R · body."""
    w, x, y, z = q
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


def tilt_deg(q: Quaternion) -> float:
    return degrees(acos(min(1.0, max(-1.0, rotation_matrix(q)[2][2]))))


def earth_from_body(q: Quaternion, vector: Vector) -> Vector:
    (a, b, c), (d, e, f), (g, h, i) = rotation_matrix(q)
    x, y, z = vector
    return (a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z)


def quaternion_from_euler(phi: float, theta: float, psi: float) -> Quaternion:
    cr, sr = cos(0.5 * phi), sin(0.5 * phi)
    cp, sp = cos(0.5 * theta), sin(0.5 * theta)
    cy, sy = cos(0.5 * psi), sin(0.5 * psi)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def euler_from_quaternion(q: Quaternion) -> Vector:
    """Return phi, theta, psi in rad: theta in [-pi/2, pi/2], the others in (-pi, pi]."""
    w, x, y, z = q
    phi = atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    theta = asin(min(1.0, max(-1.0, 2.0 * (w * y - x * z))))
    psi = atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return (phi, theta, psi)


def euler_rates(phi: float, theta: float, rate: Vector) -> Vector:
    """Return (phi', theta', psi') = T(phi, theta) · [p q r], THESIS [2.7]; singular at theta = ±pi/2."""
    p, q, r = rate
    s, c = sin(phi), cos(phi)
    swing = s * q + c * r
    return (p + sin(theta) / cos(theta) * swing, c * q - s * r, swing / cos(theta))


def nearest_turn(angle: float, reference: float) -> float:
    """Add full turns to `angle`, rad, to bring it within half a turn of `reference`."""
    return angle - 2.0 * pi * floor((angle - reference) / (2.0 * pi) + 0.5)
