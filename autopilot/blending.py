"""Smooths what is published where GPS comes back and corrects by metres: the estimate jumps, the vehicle must not.

What a correction exceeds the usual by is taken back from the published position and velocity, and given in slowly.
"""

from math import sqrt

from mavlink.frames import Vector

_USUAL_M, _USUAL_M_S = 0.05, 0.05
_GIVEN_IN_M_S, _GIVEN_IN_M_S2 = 0.5, 1.0
_NONE: Vector = (0.0, 0.0, 0.0)


class Blending:
    """What is still to be given in.

    Attributes:
        position_m: To be added to the filter's position, ENU.
        velocity_m_s: To be added to its velocity, ENU.
    """

    def __init__(self) -> None:
        """Begin with nothing."""
        self.position_m = _NONE
        self.velocity_m_s = _NONE

    def absorb(self, before: list[float], after: list[float], delay_s: float) -> None:
        """Take a correction of position and velocity (6,), made `delay_s` ago."""
        dvx, dvy, dvz = (b - a for a, b in zip(before[3:6], after[3:6], strict=True))
        moved = (
            after[0] - before[0] + delay_s * dvx,
            after[1] - before[1] + delay_s * dvy,
            after[2] - before[2] + delay_s * dvz,
        )
        self.position_m = _less(self.position_m, _beyond(moved, _USUAL_M))
        self.velocity_m_s = _less(self.velocity_m_s, _beyond((dvx, dvy, dvz), _USUAL_M_S))

    def give_in(self, interval_s: float) -> None:
        """Let time pass."""
        if self.position_m is not _NONE:
            self.position_m = _beyond(self.position_m, _GIVEN_IN_M_S * interval_s)
        if self.velocity_m_s is not _NONE:
            self.velocity_m_s = _beyond(self.velocity_m_s, _GIVEN_IN_M_S2 * interval_s)


def _beyond(vector: Vector, length: float) -> Vector:
    """Return the part of a vector that is beyond a length."""
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
