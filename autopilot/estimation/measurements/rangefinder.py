"""The rangefinder: distance along the body axis to flat ground.

The ground is at height 0 until the distance contradicts that for long; then the ground is reset, not the height.
"""

from math import inf, sqrt

import numpy as np

from colibri.autopilot.estimation.eskf_predict import ATTITUDE, ERRORS, POSITION
from colibri.autopilot.estimation.eskf_update import fuse_rows
from colibri.autopilot.estimation.measurements.instrument import FusedInstrument, MeasurementKind, Ratio, Value
from colibri.autopilot.estimation.sensing.plausibility import Watch
from colibri.autopilot.estimation.sensing.rejection import Reason, Rejected
from colibri.common.elementary import square
from colibri.common.jit import compiled
from colibri.common.kernels import cos, sin
from colibri.common.types import Array, Vector
from colibri.mavlink.hil.sensors import SensorFrame
from colibri.mavlink.wire.dialect import mav
from colibri.plant.vehicle.sensors import Sensors

_USED_BELOW_M = 5.0  # height limit, as PX4's EKF2_RNG_A_HMAX: higher up, the ground may differ from that at the start
_MIN_COSINE = 0.7  # of the tilt: beyond 45° the beam meets the ground elsewhere
_ROUGHNESS_M = 0.01
_WIRE_STEP_M = 0.01
_FROZEN_US = 500_000
_PATIENCE_US = 7_000_000


class RangefinderBelow(FusedInstrument):
    """The rangefinder of one flight; smoothed, because first corrections may be decimetres."""

    part, name, numbers = "rangefinder", "distance", 1
    source, bit, ratio = "rangefinder", mav.MAV_SYS_STATUS_SENSOR_LASER_POSITION, Ratio.ABOVE_GROUND
    smoothed = True

    def __init__(self, sensors: Sensors, _field_enu_gauss: Vector) -> None:
        part = sensors.rangefinder
        assert part is not None, "what is fitted is described"
        self._part = part
        self._beam = np.array([cos(0.5 * part.field_of_view_rad), sin(0.5 * part.field_of_view_rad)])
        self._watch = Watch(self.source, part.min_m, part.max_m, _FROZEN_US if part.noise_m > 0.0 else inf)
        self._y = np.zeros(1)
        self.kind = MeasurementKind(self.name, self.numbers, _PATIENCE_US, (POSITION, 0, 0.0))
        self.ground_m = 0.0

    def read(self, frame: SensorFrame, rejected: Rejected) -> Value | None:
        """Return the distance, m; infinity out of range."""
        if frame.distance is None:
            return None
        value = (frame.distance.distance_m,)
        return value if value == (inf,) or self._watch.accepts(value, frame.time_us, rejected) else None

    def fuse(self, x: Array, P: Array, value: Value, time_us: int) -> Reason | None:
        (distance_m,) = value
        height_m = float(x[2]) + self._part.height_m - self.ground_m
        tilted = 1.0 - 2.0 * (x[7] * x[7] + x[8] * x[8]) < _MIN_COSINE
        if distance_m == inf or distance_m > _USED_BELOW_M or height_m > _USED_BELOW_M or tilted:
            self.kind.accept(time_us)  # it works, and there is nothing to learn from it
            return None
        variance = square(self._part.noise_m) + square(self._part.noise_part * distance_m)
        variance += square(_ROUGHNESS_M) + square(_WIRE_STEP_M) / 12.0
        nis = fuse_distance(x, P, distance_m, height_m, self._beam, variance, self.kind.gate, self._y)
        if self.kind.note(time_us, tuple(self._y.tolist()), nis):
            return None
        if self.kind.reject(time_us):
            self.ground_m -= float(self._y[0])
            self.kind.reset(time_us)
        return Reason.INNOVATION

    def typical(self) -> Value:
        return (self._part.height_m,)


@compiled
def fuse_distance(
    x: Array, P: Array, measured: float, height: float, beam: Array, variance: float, gate: float, y: Array
) -> float:
    """Fuse the distance, m; return NIS.

    d = h / cos(ϑ - β) with tilt ϑ and half beam β (cosine and sine: `beam`); within the beam d = h.
    """
    w, a, b, c = x[6:10]
    up_x, up_y, up_z = 2.0 * (a * c - w * b), 2.0 * (b * c + w * a), 1.0 - 2.0 * (a * a + b * b)
    along, slope = 1.0, 0.0
    if up_z < beam[0]:
        sine = sqrt(1.0 - up_z * up_z)
        along = up_z * beam[0] + sine * beam[1]
        slope = beam[0] - up_z / sine * beam[1]
    distance = height / along
    H = np.zeros((1, ERRORS))
    H[0, POSITION + 2] = 1.0 / along
    H[0, ATTITUDE] = distance / along * slope * up_y
    H[0, ATTITUDE + 1] = -distance / along * slope * up_x
    y[0] = measured - distance
    return fuse_rows(x, P, H, y, variance, gate)
