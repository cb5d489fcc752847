"""Failures of inertial sensors that show in their noise, in biases that grow, or against two other sensors.

A sudden gyroscope bias makes magnetic field and GPS velocity both contradict the attitude. The field is rejected within
0.1 s, velocity after 1 s or 2 s. Iron also turns a field, and receivers fail, but both have one common cause. The
covariance is inflated by the turn, as PX4's EKF2 resets its yaw.
"""

from math import copysign, hypot, sqrt

from colibri.autopilot.estimation.delay_buffer import DelayBuffer, learn_drag, roughness
from colibri.autopilot.estimation.eskf import Filter
from colibri.autopilot.estimation.sensing.inertial import Inertial, InertialReading
from colibri.autopilot.estimation.sensing.rate_jump import RateJump
from colibri.plant.vehicle.sensors import Sensors

_ROUGH_M_S2, _ROUGH_RAD_S = 2.0, 0.25  # white noise of a sensor that has failed
_ROUGH_CHECKS, _ROUGH_PART = 3, 0.6  # in a row, because a knock is rough for one
_SHAKES = 6  # samples of wild rates, less the calm ones between: noise that tips a vehicle over within 0.1 s
_MIN_BIAS_M_S2, _GROWN = 0.3, 1.2
_BOTH_REJECTED_US = 300_000  # GPS velocity and barometer contradict alike: the accelerometer is the common cause
_MEAN_PART, _HIGH_SIGMAS = 0.2, 2.5  # filter gain of the mean innovation of pressures, and what contradicts
_STEEP = 9.0  # σ² of the vertical part of a contradicted velocity
_REJECTED_US = 200_000  # required rejection of GPS velocity for a gyroscope bias: three fixes at 10 Hz
_MAX_TURN_RAD = 0.3  # beyond this the field is implausible


class InertialWatch:
    """Marks the inertial sensors of one vehicle as failed."""

    def __init__(self, inertial: Inertial, sensors: Sensors, field_gauss: float) -> None:
        self._inertial = inertial
        self._rate_jump = RateJump(sensors, field_gauss)
        self._rough = [0, 0]
        self._bias_m_s2 = self._high = 0.0  # the mean innovation of the pressures, in σ
        self._pressure_us = -1

    def look(self, buffer: DelayBuffer, filter_: Filter, now_us: int, *, rate_known: bool) -> None:
        """Check the waiting samples, and the tests of the filter; `rate_known`: the gyroscope is usable."""
        inertial, rough = self._inertial, self._rough
        waiting = buffer.samples, buffer.first, len(buffer.waiting)
        parts = roughness(*waiting, _ROUGH_M_S2, _ROUGH_RAD_S)
        learn_drag(*waiting, filter_.x, filter_.drag)
        for sensor, part in enumerate(parts):
            rough[sensor] = rough[sensor] + 1 if part > _ROUGH_PART else 0
        inertial.accelerometer.failed |= rough[0] >= _ROUGH_CHECKS
        if rough[1] >= _ROUGH_CHECKS:
            self._inertial.doubt_rates(buffer.median_rate())
        test, before_us = filter_.barometer.kind.test, self._pressure_us
        self._pressure_us = test.time_us
        sigmas = copysign(sqrt(min(test.nis, test.gate)), test.innovation[0]) if test.time_us > before_us else 0.0
        self._high += _MEAN_PART * (sigmas - self._high)
        velocity = filter_.velocity
        if rate_known and velocity.rejected_us is not None and abs(self._high) > _HIGH_SIGMAS:
            east, north, up = velocity.test.innovation
            steep = up * up * velocity.test.nis > _STEEP * (east * east + north * north + up * up)
            long = now_us - velocity.rejected_us > _BOTH_REJECTED_US
            inertial.accelerometer.failed |= long and steep and up * self._high > 0.0

    def look_for_jump(
        self, buffer: DelayBuffer, filter_: Filter, before: InertialReading, now: InertialReading, interval_s: float
    ) -> None:
        """Examine the newest waiting sample, between two readings, for wild noise or a bias of the gyroscope."""
        inertial, jump, waiting = self._inertial, self._rate_jump, buffer.waiting[-1]
        time_us, values = waiting.time_us, waiting.values
        if not (before.rate_good and now.rate_good):
            jump.forget()
            jump.shakes, inertial.shaken = 0, False
            return
        if filter_.magnetometer.kind.rejected_us is not None:
            jump.forget()
            values = None
        bias = jump.look(before.rate, now.rate, interval_s, values[0] if values else None)
        if inertial.shaken != (jump.shakes > 0):
            inertial.suspect_rates(time_us - round(interval_s * 1e6), before.rate, shaken=jump.shakes > 0)
        if bias is not None:
            filter_.jump_gyro_bias(bias, buffer.add_bias(bias, jump.samples), time_us)
        if jump.shakes >= _SHAKES:
            inertial.doubt_rates()

    def look_at_bias(self, bias_m_s2: float) -> None:
        """Compare the accelerometer's largest bias after a reset with that after the last one."""
        grown = bias_m_s2 > _GROWN * self._bias_m_s2
        self._inertial.accelerometer.failed |= self._bias_m_s2 > _MIN_BIAS_M_S2 and grown
        self._bias_m_s2 = bias_m_s2

    def trust(self) -> None:
        """Use the sensors again that have failed."""
        for sensor in (self._inertial.accelerometer, self._inertial.gyroscope):
            sensor.failed = sensor.noisy = False
        self._bias_m_s2 = 0.0


def turned_since(filter_: Filter, now_us: int) -> tuple[float, float] | None:
    """Return the field's angle error, rad, and its duration, s, for a gyroscope fault."""
    velocity, field = filter_.velocity, filter_.magnetometer.kind
    if velocity.rejected_us is None or now_us - velocity.rejected_us < _REJECTED_US:
        return None
    if field.rejected_us is None or field.test.time_us <= field.rejected_us:
        return None
    angle_rad = hypot(*field.test.innovation) / filter_.field_gauss
    return (angle_rad, (field.test.time_us - field.rejected_us) * 1e-6) if angle_rad <= _MAX_TURN_RAD else None
