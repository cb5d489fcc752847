"""Messages of the sensors; under state feedback, of ideal ones."""

from colibri.common.earth.atmosphere import pressure_pa, temperature_c
from colibri.common.types import Vector
from colibri.mavlink.hil.sensors import SensorFrame
from colibri.mavlink.node.service import Fields
from colibri.mavlink.telemetry.encoder import MILLI_G, in_body_frd, times
from colibri.mavlink.telemetry.snapshot import TelemetrySnapshot
from colibri.mavlink.wire.dialect import bits
from colibri.mavlink.wire.ned import frd_from_flu

GRAVITY_M_S2 = 9.81
EARTH_FIELD_NED_GAUSS: Vector = (0.2152, 0.0124, 0.4312)  # at Zurich; used everywhere, as it is only displayed

UPDATED = bits(
    "HIGHRES_IMU_UPDATED_", "XACC YACC ZACC XGYRO YGYRO ZGYRO XMAG YMAG ZMAG ABS_PRESSURE PRESSURE_ALT TEMPERATURE"
)


def highres_imu(s: TelemetrySnapshot) -> Fields:
    """HIGHRES_IMU (105): m/s², rad/s, gauss, hPa, m, °C."""
    m = _measured(s)
    motion = (*frd_from_flu(m.specific_force_flu_m_s2), *frd_from_flu(m.rate_flu_rad_s))
    air = (m.pressure_pa / 100.0, 0.0, _altitude_amsl_m(s), m.temperature_c)
    return (s.time_us, *motion, *frd_from_flu(m.magnetic_field_flu_gauss), *air, UPDATED, 0)


def scaled_imu(s: TelemetrySnapshot) -> Fields:
    """SCALED_IMU (26): mG, mrad/s, mgauss, centidegrees Celsius."""
    m = _measured(s)
    return (s.boot_ms, *_thousandths(m), _temperature_cdeg(m))


def raw_imu(s: TelemetrySnapshot) -> Fields:
    """RAW_IMU (27): in SCALED_IMU's units."""
    m = _measured(s)
    return (s.time_us, *_thousandths(m), 0, _temperature_cdeg(m))


def scaled_pressure(s: TelemetrySnapshot) -> Fields:
    """SCALED_PRESSURE (29): hPa, centidegrees Celsius."""
    m = _measured(s)
    return (s.boot_ms, m.pressure_pa / 100.0, 0.0, _temperature_cdeg(m), 0)


def vibration(s: TelemetrySnapshot) -> Fields:
    """VIBRATION (241): zeros."""
    return (s.time_us, 0.0, 0.0, 0.0, 0, 0, 0)


def specific_force_frd(s: TelemetrySnapshot) -> Vector:
    east, north, up = s.acceleration_enu_m_s2
    return in_body_frd(s.attitude, (east, north, up + GRAVITY_M_S2))


def _measured(s: TelemetrySnapshot) -> SensorFrame:
    if s.sensed is not None:
        return s.sensed
    force = frd_from_flu(specific_force_frd(s))
    north, east, down = EARTH_FIELD_NED_GAUSS
    field = frd_from_flu(in_body_frd(s.attitude, (east, north, -down)))
    altitude_m = _altitude_amsl_m(s)
    return SensorFrame(0, 0, force, s.rate_flu_rad_s, field, pressure_pa(altitude_m), temperature_c(altitude_m))


def _altitude_amsl_m(s: TelemetrySnapshot) -> float:
    return s.origin.altitude_m + s.position_enu_m[2]


def _thousandths(m: SensorFrame) -> tuple[float, ...]:
    force, rate = frd_from_flu(m.specific_force_flu_m_s2), frd_from_flu(m.rate_flu_rad_s)
    return (*times(MILLI_G, force), *times(1e3, rate), *times(1e3, frd_from_flu(m.magnetic_field_flu_gauss)))


def _temperature_cdeg(m: SensorFrame) -> int:
    # Zero would mean that no temperature is known.
    return round(100.0 * m.temperature_c) or 1
