"""Detection of a sudden gyroscope bias, when magnetic field and GPS velocity both contradict the attitude.

The field is rejected within 0.1 s, velocity after 1 s or 2 s. Iron also turns a field, and receivers fail, but both
have one common cause. The covariance is inflated by the turn, as PX4's EKF2 resets its yaw.
"""

from math import hypot

from colibri.autopilot.estimation.eskf import Filter

_REJECTED_US = 200_000  # required rejection of GPS velocity: three fixes at 10 Hz
_MAX_TURN_RAD = 0.3  # beyond this the field is implausible


def turned_since(filter_: Filter, now_us: int) -> tuple[float, float] | None:
    """Return the field's angle error, rad, and its duration, s, for a gyroscope fault."""
    velocity, field = filter_.velocity, filter_.magnetometer.kind
    if velocity.rejected_us is None or now_us - velocity.rejected_us < _REJECTED_US:
        return None
    if field.rejected_us is None or field.test.time_us <= field.rejected_us:
        return None
    angle_rad = hypot(*field.test.innovation) / filter_.field_gauss
    return (angle_rad, (field.test.time_us - field.rejected_us) * 1e-6) if angle_rad <= _MAX_TURN_RAD else None
