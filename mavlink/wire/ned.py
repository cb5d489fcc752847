"""NED and FRD, MAVLink's axes: the only place where they are."""

from math import sqrt

from colibri.common.types import Quaternion, Vector

_HALF_SQRT2 = sqrt(0.5)


def ned_from_enu(vector: Vector) -> Vector:
    """Convert an earth vector from ENU to NED, or from NED to ENU: the map is its own inverse."""
    x, y, z = vector
    return (y, x, -z)


def frd_from_flu(vector: Vector) -> Vector:
    """Convert a body vector from FLU to FRD, or from FRD to FLU: the map is its own inverse."""
    x, y, z = vector
    return (x, -y, -z)


def ned_frd_from_enu_flu(q: Quaternion) -> Quaternion:
    """Convert an attitude from ENU/FLU to NED/FRD, or back: the map is its own inverse.

    In Euler angles: roll stays, pitch changes its sign, yaw becomes pi/2 - yaw.
    """
    w, x, y, z = q
    return (_HALF_SQRT2 * (w + z), _HALF_SQRT2 * (x + y), _HALF_SQRT2 * (x - y), _HALF_SQRT2 * (w - z))
