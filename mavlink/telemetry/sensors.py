"""Messages of the sensors, of which there are none while the state itself is fed back: what they would measure."""

from mavlink.atmosphere import pressure_pa, temperature_c
from mavlink.dialect import mav
from mavlink.frames import Vector, frd_from_flu
from mavlink.services.service import Fields
from mavlink.snapshot import Snapshot
from mavlink.telemetry.wire import MILLI_G, Constants, boot_ms, in_body_frd, times

EARTH_FIELD_NED_GAUSS: Vector = (0.2152, 0.0124, 0.4312)
"""The earth's field at Zurich: 0.482 gauss, dipping 63.4° below the horizon, 3.3° east of true north. Taken everywhere:
nothing in here steers by it."""

UPDATED: int = (
    mav.HIGHRES_IMU_UPDATED_XACC
    | mav.HIGHRES_IMU_UPDATED_YACC
    | mav.HIGHRES_IMU_UPDATED_ZACC
    | mav.HIGHRES_IMU_UPDATED_XGYRO
    | mav.HIGHRES_IMU_UPDATED_YGYRO
    | mav.HIGHRES_IMU_UPDATED_ZGYRO
    | mav.HIGHRES_IMU_UPDATED_XMAG
    | mav.HIGHRES_IMU_UPDATED_YMAG
    | mav.HIGHRES_IMU_UPDATED_ZMAG
    | mav.HIGHRES_IMU_UPDATED_ABS_PRESSURE
    | mav.HIGHRES_IMU_UPDATED_PRESSURE_ALT
    | mav.HIGHRES_IMU_UPDATED_TEMPERATURE
)


def highres_imu(s: Snapshot, c: Constants) -> Fields:
    """HIGHRES_IMU (105): m/s², rad/s, gauss, hPa, m, °C."""
    altitude_m = altitude_amsl_m(s)
    air = (pressure_hpa(altitude_m), 0.0, altitude_m, temperature_c(altitude_m))
    return (s.time_us, *specific_force_frd(s, c), *frd_from_flu(s.rate_flu_rad_s), *field_frd(s), *air, UPDATED, 0)


def scaled_imu(s: Snapshot, c: Constants) -> Fields:
    """SCALED_IMU (26): mG, mrad/s, mgauss, centidegrees Celsius."""
    return (boot_ms(s), *_thousandths(s, c), _temperature_cdeg(s))


def raw_imu(s: Snapshot, c: Constants) -> Fields:
    """RAW_IMU (27): counts of a sensor whose units are those of SCALED_IMU."""
    return (s.time_us, *_thousandths(s, c), 0, _temperature_cdeg(s))


def scaled_pressure(s: Snapshot) -> Fields:
    """SCALED_PRESSURE (29): hPa, centidegrees Celsius."""
    return (boot_ms(s), pressure_hpa(altitude_amsl_m(s)), 0.0, _temperature_cdeg(s), 0)


def vibration(s: Snapshot) -> Fields:
    """VIBRATION (241): a state that is fed back does not shake."""
    return (s.time_us, 0.0, 0.0, 0.0, 0, 0, 0)


def specific_force_frd(s: Snapshot, c: Constants) -> Vector:
    """What accelerometers measure: acceleration without gravity's, m/s², in the body's FRD."""
    east, north, up = s.acceleration_enu_m_s2
    return in_body_frd(s.attitude, (east, north, up + c.gravity_m_s2))


def field_frd(s: Snapshot) -> Vector:
    """What magnetometers measure, gauss, in the body's FRD."""
    north, east, down = EARTH_FIELD_NED_GAUSS
    return in_body_frd(s.attitude, (east, north, -down))


def altitude_amsl_m(s: Snapshot) -> float:
    """Altitude above the sea."""
    return s.origin.altitude_m + s.position_enu_m[2]


def pressure_hpa(altitude_m: float) -> float:
    """Pressure of the standard atmosphere."""
    return pressure_pa(altitude_m) / 100.0


def _thousandths(s: Snapshot, c: Constants) -> tuple[float, ...]:
    rate = times(1e3, frd_from_flu(s.rate_flu_rad_s))
    return (*times(MILLI_G, specific_force_frd(s, c)), *rate, *times(1e3, field_frd(s)))


def _temperature_cdeg(s: Snapshot) -> int:
    # Zero would mean that no temperature is known.
    return round(100.0 * temperature_c(altitude_amsl_m(s))) or 1
