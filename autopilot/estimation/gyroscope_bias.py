"""Notices that the gyroscope is suddenly off, when magnetic field and GPS velocity both contradict the attitude.

A bias of the rate that is there from one instant on turns the filter's attitude away from the vehicle's. The magnetic
field is rejected within a tenth of a second, GPS velocity after another second or two, since thrust then points
elsewhere. Either alone proves nothing: iron turns a field, and a receiver may lie. Together they leave only what they
have in common. The covariance of attitude and bias is then inflated by as much as the field has turned since, and the
filter finds both by itself. PX4's EKF2 likewise resets its yaw where field and GPS velocity contradict it.
"""

from math import hypot

from colibri.autopilot.estimation.eskf import Filter

_REJECTED_US = 200_000
"""Of GPS velocity, before it is a witness: three fixes at 10 Hz."""
_MAX_TURN_RAD = 0.3
"""Beyond that the field is not plausible either."""


def turned_since(filter_: Filter, now_us: int) -> tuple[float, float] | None:
    """Return by what angle the field is off, rad, and for how long, s, if a gyroscope is; after the test of a fix."""
    velocity, field = filter_.velocity, filter_.magnetometer.kind
    if velocity.rejected_us is None or now_us - velocity.rejected_us < _REJECTED_US:
        return None
    if field.rejected_us is None or field.test.time_us <= field.rejected_us:
        return None
    angle_rad = hypot(*field.test.innovation) / filter_.field_gauss
    return (angle_rad, (field.test.time_us - field.rejected_us) * 1e-6) if angle_rad <= _MAX_TURN_RAD else None
