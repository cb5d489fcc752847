"""The magnetometer: the earth's field plus the vehicle's own."""

from collections import deque
from collections.abc import Sequence
from math import hypot, radians

import numpy as np

from colibri.autopilot.estimation import eskf_update as update
from colibri.autopilot.estimation.eskf_predict import ATTITUDE, GYRO_BIAS, HARD_IRON
from colibri.autopilot.estimation.measurements.instrument import FusedInstrument, MeasurementKind, Ratio, Value
from colibri.autopilot.estimation.sensing.field_lag import FieldLag
from colibri.autopilot.estimation.sensing.plausibility import Watch
from colibri.autopilot.estimation.sensing.rejection import Reason, Rejected, RejectedSource
from colibri.common.elementary import square
from colibri.common.types import Array, Vector
from colibri.mavlink.hil.sensors import SensorFrame, Updated
from colibri.mavlink.wire.dialect import mav
from colibri.plant.vehicle.sensors import Sensors

_MAX_GAUSS = 4.0
_FROZEN_US = 500_000
_MIN_NOISE_GAUSS = 1e-6
_STRENGTH_PART, _DIP_RAD = 0.2, radians(15.0)  # allowed deviations from the earth's field in strength and inclination
_PATIENCE_US = 10_000_000
_INFLATED_GAUSS = 0.3
_MEAN_S = 1.0
_DRIFT_SIGMAS, _DRIFT_GAUSS = 8.0, 0.004  # the mean strength has drifted if its deviation exceeds both
_DOUBT_SIGMAS, _DOUBT_GAUSS = 20.0, 0.004  # of a mean innovation that contradicts the model; healthy: below 10
_DOUBT_RAD_S, _DOUBT_IRON_GAUSS = 0.02, 0.1  # what gyroscope bias and own field may then have become

_KEEPS_US, _BIASES = 1_000_000, 3  # biases kept: those of 2 to 3 s ago are from before a late field was seen
_LATE_RAD = 0.05  # attitude error by then
_NEVER = -1.0  # gate of a measurement that is only predicted


class MagnetometerFusion(FusedInstrument):
    """The magnetometer of one flight; `variance` in gauss².

    A slow drift of this sensor or of the gyroscope passes the test of each sample and turns the attitude. It is seen in
    means. The mean strength, which no error of the attitude changes, convicts the magnetometer. A mean innovation
    does not tell which of the two drifts: both become less certain, and GPS velocity decides; not before
    `doubt_from_us`, as the filter's first attitude may be wrong.
    """

    part, name, numbers = "magnetometer", "field", 3
    source, bit, ratio = RejectedSource.MAGNETOMETER, mav.MAV_SYS_STATUS_SENSOR_3D_MAG, Ratio.FIELD
    group = Updated.MAGNETOMETER

    def __init__(self, sensors: Sensors, field_enu_gauss: Vector) -> None:
        self._field = np.array(field_enu_gauss)
        self.variance = square(max(sensors.magnetometer.noise_gauss, _MIN_NOISE_GAUSS))
        self.kind = MeasurementKind(self.name, self.numbers, _PATIENCE_US, (HARD_IRON, 3, _INFLATED_GAUSS))
        self._watch = Watch(self.source, -_MAX_GAUSS, _MAX_GAUSS, _FROZEN_US)
        self._strength_gauss = hypot(*field_enu_gauss)
        self._deviation_gauss = 0.0  # mean of the strength's
        self._mean: Vector = (0.0, 0.0, 0.0)  # of the innovations, gauss
        self._mean_us = 0
        self.doubt_from_us = 0
        self._lag = FieldLag(self.variance)
        self._biases: deque[Array] = deque(maxlen=_BIASES)  # the filter's gyroscope biases, rad/s, one each second
        self._kept_us = 0
        self._innovation = np.zeros(self.numbers)
        self.misled = False  # whether the attitude has followed a drift

    def read(self, frame: SensorFrame, rejected: Rejected) -> Value | None:
        """Return the field, gauss FLU."""
        if frame.updated & self.group != self.group:
            return None
        value = frame.magnetic_field_flu_gauss
        return value if self._watch.accepts(value, frame.time_us, rejected) and self._watch.is_new else None

    def fuse(self, x: Array, P: Array, value: Value, time_us: int) -> Reason | None:
        measured = np.array(value)
        if self._lag.late:
            update.fuse_field(x, P, measured, self._field, self.variance, _NEVER, self._innovation)
            self._compare(value, self._innovation.tolist(), time_us)
            self.kind.reject(time_us)
            return Reason.FIELD
        is_of_earth = update.is_of_earth(x, measured, self._field, _STRENGTH_PART, _DIP_RAD)
        part = min((time_us - self._mean_us) * 1e-6 / _MEAN_S, 1.0)
        self._mean_us = time_us
        drifts = self._drifts(x, P, value, part)
        self.misled |= drifts and self.kind.rejected_us is None
        if (drifts or not is_of_earth) and not self.kind.reject(time_us):
            return Reason.FIELD
        resets = self.kind.resets
        take = self.kind.force_accept if drifts else self.kind.fuse
        accepted = take(x, P, time_us, update.fuse_field, measured, self._field, self.variance)
        self._compare(value, self.kind.test.innovation, time_us)
        if self._lag.late:
            self._doubt_gyroscope(x, P)
        elif time_us >= self._kept_us + _KEEPS_US:
            self._kept_us = time_us
            self._biases.append(x[10:13].copy())
        if self.kind.resets != resets:
            self._deviation_gauss, self._mean = 0.0, (0.0, 0.0, 0.0)
        elif accepted and time_us >= self.doubt_from_us:
            self._doubt(P, part)
        return None if accepted else Reason.INNOVATION

    def convict(self, x: Array, P: Array, now_us: int) -> bool:
        """Reject a suspect field if GPS velocity contradicts the attitude as well; return whether it begins now."""
        if self._lag.late or not self._lag.convict(now_us):
            return False
        self._doubt_gyroscope(x, P)
        return True

    def _compare(self, value: Value, innovation: Sequence[float], time_us: int) -> None:
        (x, y, z), (a, b, c) = value, innovation
        self._lag.add((x, y, z), (x - a, y - b, z - c), time_us)

    def _doubt_gyroscope(self, x: Array, P: Array) -> None:
        """Return to the gyroscope bias from before the field came late."""
        x[10:13] = self._biases[0] if self._biases else x[10:13]
        self._biases.clear()
        update.inflate_covariance(P, ATTITUDE, 3, square(_LATE_RAD))
        update.inflate_covariance(P, GYRO_BIAS, 3, square(_DOUBT_RAD_S))

    def _drifts(self, x: Array, P: Array, value: Value, part: float) -> bool:
        own_x, own_y, own_z = x[-3:].tolist()
        own = (value[0] - own_x, value[1] - own_y, value[2] - own_z)
        strength = hypot(*own)
        self._deviation_gauss += part * (strength - self._strength_gauss - self._deviation_gauss)
        if abs(self._deviation_gauss) <= _DRIFT_GAUSS:
            return False
        iron = sum(own[i] * own[j] * P[i - 3, j - 3] for i in range(3) for j in range(3)) / square(strength)
        return bool(square(self._deviation_gauss) > square(_DRIFT_SIGMAS) * (0.5 * part * self.variance + iron))

    def _doubt(self, P: Array, part: float) -> None:
        (a, b, c), (mx, my, mz) = self.kind.test.innovation, self._mean
        self._mean = mx, my, mz = (mx + part * (a - mx), my + part * (b - my), mz + part * (c - mz))
        squared = mx * mx + my * my + mz * mz
        if squared <= max(square(_DOUBT_GAUSS), square(_DOUBT_SIGMAS) * 0.5 * part * self.variance):
            return
        self._mean = (0.0, 0.0, 0.0)
        update.inflate_covariance(P, ATTITUDE, 3, squared / square(self._strength_gauss))
        update.inflate_covariance(P, GYRO_BIAS, 3, square(_DOUBT_RAD_S))
        update.inflate_covariance(P, HARD_IRON, 3, square(_DOUBT_IRON_GAUSS))

    def typical(self) -> Value:
        return tuple(self._field.tolist())
