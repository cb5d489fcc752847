"""Conversions between ENU/FLU and MAVLink's NED/FRD; each is its own inverse."""

from math import sqrt
from typing import TypeVar

from colibri.common.types import Array

_Number = TypeVar("_Number", float, Array)  # one vector, or a column of many per component
_HALF_SQRT2 = sqrt(0.5)


def ned_from_enu(vector: tuple[_Number, _Number, _Number]) -> tuple[_Number, _Number, _Number]:
    """Convert an earth vector from ENU to NED, or back."""
    x, y, z = vector
    return (y, x, -z)


def frd_from_flu(vector: tuple[_Number, _Number, _Number]) -> tuple[_Number, _Number, _Number]:
    """Convert a body vector from FLU to FRD, or back."""
    x, y, z = vector
    return (x, -y, -z)


def ned_frd_from_enu_flu(q: tuple[_Number, _Number, _Number, _Number]) -> tuple[_Number, _Number, _Number, _Number]:
    """Convert an attitude from ENU/FLU to NED/FRD, or back."""
    w, x, y, z = q
    return (_HALF_SQRT2 * (w + z), _HALF_SQRT2 * (x + y), _HALF_SQRT2 * (x - y), _HALF_SQRT2 * (w - z))
