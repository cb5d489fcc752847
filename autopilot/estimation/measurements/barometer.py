"""The barometer: height with a drifting offset."""

from colibri.autopilot.estimation import eskf_update as update
from colibri.autopilot.estimation.eskf_predict import BARO_OFFSET
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
_TYPICAL_PA = 95e3


class BarometerFusion(FusedInstrument):
    """The barometer of one flight; `height_m` is of the last pressure."""

    part, name, numbers = "barometer", "pressure", 1
    source, bit, ratio = RejectedSource.BAROMETER, mav.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE, Ratio.HEIGHT
    group = Updated.BAROMETER

    def __init__(self, sensors: Sensors, _field_enu_gauss: Vector) -> None:
        self._noise_pa = sensors.barometer.noise_pa
        self.kind = MeasurementKind(self.name, self.numbers, _PATIENCE_US, (BARO_OFFSET, 1, _INFLATED_M))
        self._watch = Watch(self.source, _MIN_PA, _MAX_PA, _FROZEN_US)
        self.height_m = 0.0

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
        accepted = self.kind.fuse(x, P, time_us, update.fuse_pressure_height, height, variance)
        return None if accepted else Reason.INNOVATION

    def typical(self) -> Value:
        return (_TYPICAL_PA,)
