"""Smoothing of the published state, because the filter jumps with every fix.

Position corrections decay by a time constant, as in PX4's output predictor, large ones at a limited speed. Velocity
corrections are smoothed only if unusual, because the controller needs them.
"""

from math import sqrt

from colibri.common.kernels import exp
from colibri.common.types import Vector

_TIME_CONSTANT_S = 1.0
_USUAL_M_S = 0.05
_GIVEN_IN_M_S, _GIVEN_IN_M_S2 = 0.5, 1.0
_MIN_M = 1e-6
_NONE: Vector = (0.0, 0.0, 0.0)


class OutputSmoothing:
    """Published minus filter, ENU."""

    def __init__(self) -> None:
        self.position_m = _NONE
        self.velocity_m_s = _NONE

    def absorb(self, before: list[float], after: list[float], delay_s: float) -> None:
        """Smooth a correction (6,) made `delay_s` ago."""
        (x, y, z, vx, vy, vz), (x1, y1, z1, vx1, vy1, vz1) = before, after
        dvx, dvy, dvz = vx1 - vx, vy1 - vy, vz1 - vz
        moved = (x1 - x + delay_s * dvx, y1 - y + delay_s * dvy, z1 - z + delay_s * dvz)
        self.position_m = _less(self.position_m, moved)
        self.velocity_m_s = _less(self.velocity_m_s, _beyond((dvx, dvy, dvz), _USUAL_M_S))

    def follow(self) -> None:
        """Publish the filter's velocity at once."""
        self.velocity_m_s = _NONE

    def give_in(self, interval_s: float) -> None:
        if self.position_m is not _NONE:
            self.position_m = _faded(self.position_m, interval_s)
        if self.velocity_m_s is not _NONE:
            self.velocity_m_s = _beyond(self.velocity_m_s, _GIVEN_IN_M_S2 * interval_s)


def _faded(vector: Vector, interval_s: float) -> Vector:
    x, y, z = vector
    norm = sqrt(x * x + y * y + z * z)
    if norm <= _MIN_M:
        return _NONE
    left = max(exp(-interval_s / _TIME_CONSTANT_S), 1.0 - _GIVEN_IN_M_S * interval_s / norm)
    return (left * x, left * y, left * z)


def _beyond(vector: Vector, length: float) -> Vector:
    x, y, z = vector
    norm = sqrt(x * x + y * y + z * z)
    if norm <= length:
        return _NONE
    part = 1.0 - length / norm
    return (part * x, part * y, part * z)


def _less(vector: Vector, part: Vector) -> Vector:
    if part is _NONE:
        return vector
    return (vector[0] - part[0], vector[1] - part[1], vector[2] - part[2])
