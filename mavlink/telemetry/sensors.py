"""Messages of the sensors; under state feedback, of ideal ones."""

from colibri.common.earth.atmosphere import pressure_pa, temperature_c
from colibri.common.types import Vector
from colibri.mavlink.node.service import Fields
from colibri.mavlink.telemetry.encoder import MILLI_G, boot_ms, in_body_frd, times
from colibri.mavlink.telemetry.snapshot import Snapshot
from colibri.mavlink.wire.dialect import bits
from colibri.mavlink.wire.ned import frd_from_flu

GRAVITY_M_S2 = 9.81
EARTH_FIELD_NED_GAUSS: Vector = (0.2152, 0.0124, 0.4312)
"""The earth's field at Zurich: 0.482 gauss, 63.4° below the horizon, 3.3° east of true north. Used everywhere, as it is
only displayed.
"""

UPDATED = bits(
    "HIGHRES_IMU_UPDATED_",
    "XACC YACC ZACC XGYRO YGYRO ZGYRO XMAG YMAG ZMAG ABS_PRESSURE PRESSURE_ALT TEMPERATURE",
)


def highres_imu(s: Snapshot) -> Fields:
    """HIGHRES_IMU (105): m/s², rad/s, gauss, hPa, m, °C."""
    altitude_m = altitude_amsl_m(s)
    air = (static_hpa(s), 0.0, altitude_m, air_c(s))
    return (s.time_us, *specific_force_frd(s), *measured_rate_frd(s), *field_frd(s), *air, UPDATED, 0)


def scaled_imu(s: Snapshot) -> Fields:
    """SCALED_IMU (26): mG, mrad/s, mgauss, centidegrees Celsius."""
    return (boot_ms(s), *_thousandths(s), _temperature_cdeg(s))


def raw_imu(s: Snapshot) -> Fields:
    """RAW_IMU (27): the counts equal SCALED_IMU's units."""
    return (s.time_us, *_thousandths(s), 0, _temperature_cdeg(s))


def scaled_pressure(s: Snapshot) -> Fields:
    """SCALED_PRESSURE (29): hPa, centidegrees Celsius."""
    return (boot_ms(s), static_hpa(s), 0.0, _temperature_cdeg(s), 0)


def vibration(s: Snapshot) -> Fields:
    """VIBRATION (241): zeros."""
    return (s.time_us, 0.0, 0.0, 0.0, 0, 0, 0)


def specific_force_frd(s: Snapshot) -> Vector:
    if s.sensed is not None:
        return frd_from_flu(s.sensed.specific_force_flu_m_s2)
    east, north, up = s.acceleration_enu_m_s2
    return in_body_frd(s.attitude, (east, north, up + GRAVITY_M_S2))


def field_frd(s: Snapshot) -> Vector:
    if s.sensed is not None:
        return frd_from_flu(s.sensed.magnetic_field_flu_gauss)
    north, east, down = EARTH_FIELD_NED_GAUSS
    return in_body_frd(s.attitude, (east, north, -down))


def measured_rate_frd(s: Snapshot) -> Vector:
    return frd_from_flu(s.rate_flu_rad_s if s.sensed is None else s.sensed.rate_flu_rad_s)


def static_hpa(s: Snapshot) -> float:
    return (pressure_pa(altitude_amsl_m(s)) if s.sensed is None else s.sensed.pressure_pa) / 100.0


def air_c(s: Snapshot) -> float:
    return temperature_c(altitude_amsl_m(s)) if s.sensed is None else s.sensed.temperature_c


def altitude_amsl_m(s: Snapshot) -> float:
    return s.origin.altitude_m + s.position_enu_m[2]


def _thousandths(s: Snapshot) -> tuple[float, ...]:
    rate = times(1e3, measured_rate_frd(s))
    return (*times(MILLI_G, specific_force_frd(s)), *rate, *times(1e3, field_frd(s)))


def _temperature_cdeg(s: Snapshot) -> int:
    # Zero would mean that no temperature is known.
    return round(100.0 * air_c(s)) or 1
