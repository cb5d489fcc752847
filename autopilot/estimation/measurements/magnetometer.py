"""The magnetometer: the earth's field plus the vehicle's own."""

from math import radians

import numpy as np

from colibri.autopilot.estimation import eskf_update as update
from colibri.autopilot.estimation.eskf_predict import HARD_IRON
from colibri.autopilot.estimation.measurements.instrument import FusedInstrument, Ratio, Value
from colibri.autopilot.estimation.measurements.kind import MeasurementKind
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
_STRENGTH_PART, _DIP_RAD = 0.2, radians(15.0)
"""Allowed deviations from the earth's field in strength and inclination."""
_PATIENCE_US = 10_000_000
_INFLATED_GAUSS = 0.3


class MagnetometerFusion(FusedInstrument):
    """The magnetometer of one flight; `variance` in gauss²."""

    part, name, numbers = "magnetometer", "field", 3
    source, bit, ratio = RejectedSource.MAGNETOMETER, mav.MAV_SYS_STATUS_SENSOR_3D_MAG, Ratio.FIELD
    group = Updated.MAGNETOMETER

    def __init__(self, sensors: Sensors, field_enu_gauss: Vector) -> None:
        self._field = np.array(field_enu_gauss)
        self.variance = square(max(sensors.magnetometer.noise_gauss, _MIN_NOISE_GAUSS))
        self.kind = MeasurementKind(self.name, self.numbers, _PATIENCE_US, (HARD_IRON, 3, _INFLATED_GAUSS))
        self._watch = Watch(self.source, -_MAX_GAUSS, _MAX_GAUSS, _FROZEN_US)

    def read(self, frame: SensorFrame, rejected: Rejected) -> Value | None:
        """Return the field, gauss FLU."""
        if frame.updated & self.group != self.group:
            return None
        value = frame.magnetic_field_flu_gauss
        return value if self._watch.accepts(value, frame.time_us, rejected) and self._watch.is_new else None

    def fuse(self, x: Array, P: Array, value: Value, time_us: int) -> Reason | None:
        measured = np.array(value)
        is_of_earth = update.is_of_earth(x, measured, self._field, _STRENGTH_PART, _DIP_RAD)
        if not is_of_earth and not self.kind.reject(time_us):
            return Reason.FIELD
        accepted = self.kind.fuse(x, P, time_us, update.fuse_field, measured, self._field, self.variance)
        return None if accepted else Reason.INNOVATION

    def typical(self) -> Value:
        return tuple(self._field.tolist())
