"""Inertial samples from frames."""

from math import inf
from typing import NamedTuple

from colibri.autopilot.estimation.sensing.plausibility import Watch
from colibri.autopilot.estimation.sensing.rejection import Rejected, Source
from colibri.common.types import Vector
from colibri.mavlink.hil.sensors import SensorFrame, Updated
from colibri.plant.vehicle.sensors import Sensors

Sample = tuple[float, ...]
"""Columns of `eskf_predict.SAMPLE`."""

_BEYOND_RANGE = 1.01
"""Tolerance for resolution at the end of the range."""
_PATIENCE_US = 100_000
_BRIDGED_US = 20_000
"""Validity of the last good value when values are missing."""


class _Axes:
    """One of the two sensors."""

    def __init__(self, source: Source, group: int, maximum: float, noise: float) -> None:
        self._group = group
        maximum *= _BEYOND_RANGE
        self._watch = Watch(source, -maximum, maximum, _PATIENCE_US if noise > 0.0 else inf)
        self._time_us: int | None = None
        self.value: Vector = (0.0, 0.0, 0.0)

    def read(self, frame: SensorFrame, value: Vector, rejected: Rejected) -> bool:
        if frame.updated & self._group == self._group and self._watch.accepts(value, frame.time_us, rejected):
            self.value, self._time_us = value, frame.time_us
            return True
        return self._time_us is not None and frame.time_us - self._time_us <= _BRIDGED_US


class Reading(NamedTuple):
    """Inertial values, m/s² and rad/s, FLU, and whether each is usable."""

    force: Vector
    rate: Vector
    force_good: bool
    rate_good: bool


class Inertial:
    """Reads both sensors."""

    def __init__(self, sensors: Sensors, rejected: Rejected) -> None:
        accel, gyro = sensors.accelerometer, sensors.gyroscope
        self._rejected = rejected
        self._force = _Axes(
            Source.ACCELEROMETER, Updated.ACCELEROMETER, accel.range_m_s2, accel.noise_density_m_s2_rthz
        )
        self._rate = _Axes(Source.GYROSCOPE, Updated.GYROSCOPE, gyro.range_rad_s, gyro.noise_density_rad_s_rthz)

    def read(self, frame: SensorFrame) -> Reading:
        force_good = self._force.read(frame, frame.specific_force_flu_m_s2, self._rejected)
        rate_good = self._rate.read(frame, frame.rate_flu_rad_s, self._rejected)
        return Reading(self._force.value, self._rate.value, force_good, rate_good)


def sample_between(before: Reading, now: Reading, interval_s: float) -> Sample:
    """Return the sample between two frames (trapezoidal rule)."""
    (ax, ay, az), (bx, by, bz) = before.force, now.force
    (ap, aq, ar), (bp, bq, br) = before.rate, now.rate
    return (
        interval_s,
        0.5 * (ax + bx),
        0.5 * (ay + by),
        0.5 * (az + bz),
        0.5 * (ap + bp),
        0.5 * (aq + bq),
        0.5 * (ar + br),
        0.0 if before.force_good and now.force_good else 1.0,
        0.0 if before.rate_good and now.rate_good else 1.0,
    )
