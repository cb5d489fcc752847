"""The barometer: height with a drifting offset."""

from colibri.autopilot.estimation import eskf_update as update
from colibri.autopilot.estimation.eskf_predict import BARO_OFFSET, POSITION, VELOCITY
from colibri.autopilot.estimation.measurements.instrument import FusedInstrument, MeasurementKind, Ratio, Value
from colibri.autopilot.estimation.sensing.plausibility import Watch
from colibri.autopilot.estimation.sensing.rejection import Reason, Rejected, RejectedSource
from colibri.common.earth.atmosphere import METRES_PER_PASCAL, altitude_m, altitude_slope_m_pa
from colibri.common.elementary import square
from colibri.common.types import Array, Vector
from colibri.mavlink.hil.sensors import SensorFrame, Updated
from colibri.mavlink.wire.dialect import mav
from colibri.plant.vehicle.sensors import Sensors

_MIN_PA, _MAX_PA = 20e3, 115e3
_FROZEN_US = 500_000
_MIN_NOISE_M = 1e-6
_PATIENCE_US = 7_000_000
_INFLATED_M = 100.0
_DRIFTS_US = 10_000_000  # rejected again so soon after an acceptance by force, the pressure drifts
_DRIFTED_US = 60_000_000  # then it is rejected for so long,
_ALONE_US = 1_000_000  # and while the height of GPS has not been accepted for so long
_MISLED_M, _MISLED_M_S = 3.0, 1.0  # errors of height and climb rate by a drift
_TYPICAL_PA = 95e3


class BarometerFusion(FusedInstrument):
    """The barometer of one flight; `height_m` is of the last pressure.

    Without GPS the filter follows a pressure that drifts, and the vehicle climbs without end. So a barometer with a
    detected drift is not used without GPS.
    """

    part, name, numbers = "barometer", "pressure", 1
    source, bit, ratio = RejectedSource.BAROMETER, mav.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE, Ratio.HEIGHT
    group = Updated.BAROMETER

    def __init__(self, sensors: Sensors, _field_enu_gauss: Vector) -> None:
        self._noise_pa = sensors.barometer.noise_pa
        self.kind = MeasurementKind(self.name, self.numbers, _PATIENCE_US, (BARO_OFFSET, 1, _INFLATED_M))
        self._watch = Watch(self.source, _MIN_PA, _MAX_PA, _FROZEN_US)
        self.height_m = 0.0
        self._forced_us = self.height_known_us = -_DRIFTED_US  # acceptance by force, accepted height of GPS
        self._drifts = False

    @property
    def variance(self) -> float:
        """Height variance near sea level, m²."""
        return square(max(self._noise_pa * METRES_PER_PASCAL, _MIN_NOISE_M))

    def read(self, frame: SensorFrame, rejected: Rejected) -> Value | None:
        """Return the pressure, Pa."""
        if frame.updated & self.group != self.group:
            return None
        value = (frame.pressure_pa,)
        return value if self._watch.accepts(value, frame.time_us, rejected) and self._watch.is_new else None

    def fuse(self, x: Array, P: Array, value: Value, time_us: int) -> Reason | None:
        (pressure_pa,) = value
        height = self.height_m = altitude_m(pressure_pa)
        variance = square(max(-self._noise_pa * altitude_slope_m_pa(pressure_pa), _MIN_NOISE_M))
        if self._drifts and self.kind.rejected_us is not None and not self._is_tried_again(time_us):
            return Reason.INNOVATION
        resets, was_accepted = self.kind.resets, self.kind.rejected_us is None
        accepted = self.kind.fuse(x, P, time_us, update.fuse_pressure_height, height, variance)
        if self.kind.resets != resets:
            self._forced_us = time_us
        elif was_accepted and time_us > self._forced_us + _DRIFTS_US:
            self._drifts = False
        elif was_accepted and not accepted:
            self._drifts = True
            self._doubt(P)
        return None if accepted else Reason.INNOVATION

    def _doubt(self, P: Array) -> None:
        """Inflate the variances of height and climb rate; without GPS both then count as unknown."""
        update.inflate_covariance(P, POSITION + 2, 1, square(_MISLED_M))
        update.inflate_covariance(P, VELOCITY + 2, 1, square(_MISLED_M_S))

    def _is_tried_again(self, now_us: int) -> bool:
        rejected_us = self.kind.rejected_us or 0
        return now_us - rejected_us > _DRIFTED_US and now_us - self.height_known_us < _ALONE_US

    def typical(self) -> Value:
        return (_TYPICAL_PA,)
