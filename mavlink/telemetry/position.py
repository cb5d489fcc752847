"""Messages of position, velocity and home."""

from math import hypot, isfinite, nan

from colibri.common.compiled_rotations import euler_from_quaternion
from colibri.common.earth.geodesy import geodetic_of
from colibri.common.kernels import atan2, cos, sin
from colibri.mavlink.node.service import Fields
from colibri.mavlink.telemetry.encoder import UNKNOWN_U16, compass_cdeg, degrees_e7, yaw_ned
from colibri.mavlink.telemetry.snapshot import TelemetrySnapshot
from colibri.mavlink.wire.dialect import mav
from colibri.mavlink.wire.ned import ned_from_enu

SATELLITES = 12  # under open sky, for a vehicle without a receiver: its position is the state itself
DILUTION_E2 = 70
RANGE_CM = (0, 10_000)
PERCENT = 100


def global_position_int(s: TelemetrySnapshot) -> Fields:
    """GLOBAL_POSITION_INT (33): degE7, mm, cm/s NED, centidegrees."""
    place = s.place
    _, _, yaw = euler_from_quaternion(s.attitude)
    heading = compass_cdeg(yaw) if isfinite(yaw) else UNKNOWN_U16
    altitudes_mm = (1e3 * place.altitude_m, 1e3 * s.height_above_home_m)
    return (s.boot_ms, *degrees_e7(place), *altitudes_mm, *s.velocity_ned_cm_s, heading)


def local_position_ned(s: TelemetrySnapshot) -> Fields:
    """LOCAL_POSITION_NED (32): m and m/s."""
    return (s.boot_ms, *ned_from_enu(s.position_enu_m), *ned_from_enu(s.velocity_enu_m_s))


def home_position(s: TelemetrySnapshot) -> Fields | None:
    """HOME_POSITION (242): ground level, heading in q, vertical approach."""
    if s.home is None:
        return None
    place = geodetic_of(s.home.position_enu_m, s.origin)
    local = ned_from_enu(s.home.position_enu_m)
    half = 0.5 * yaw_ned(s.home.yaw_rad)
    surface = (cos(half), 0.0, 0.0, sin(half))
    return (*degrees_e7(place), 1e3 * place.altitude_m, *local, surface, *local, s.time_us)


def gps_global_origin(s: TelemetrySnapshot) -> Fields:
    """GPS_GLOBAL_ORIGIN (49): degE7, mm."""
    return (*degrees_e7(s.origin), 1e3 * s.origin.altitude_m, s.time_us)


def gps_raw_int(s: TelemetrySnapshot) -> Fields:
    """GPS_RAW_INT (24): the receiver's fix; a simulated one under state feedback. Course is unknown at rest."""
    if not s.gps_ok:
        nothing = (UNKNOWN_U16, UNKNOWN_U16, UNKNOWN_U16, UNKNOWN_U16)
        return (s.time_us, mav.GPS_FIX_TYPE_NO_GPS, 0, 0, 0, *nothing, 0)
    if s.fix is not None:
        place, (east, north, _), kind, seen = s.fix.place, s.fix.velocity_enu_m_s, s.fix.fix_type, s.fix.satellites
    else:
        place, (east, north, _), kind, seen = s.place, s.velocity_enu_m_s, mav.GPS_FIX_TYPE_3D_FIX, SATELLITES
    speed = hypot(east, north)
    course = compass_cdeg(atan2(north, east)) if speed > 0.1 else UNKNOWN_U16
    fix = (kind, *degrees_e7(place), 1e3 * place.altitude_m, DILUTION_E2, DILUTION_E2)
    return (s.time_us, *fix, min(100.0 * speed, UNKNOWN_U16 - 1), course, seen)


def altitude(s: TelemetrySnapshot) -> Fields:
    """ALTITUDE (141), m: monotonic, above sea level, origin, home, terrain; bottom clearance."""
    above_origin = s.position_enu_m[2]
    above_sea, above_ground = above_origin + s.origin.altitude_m, above_origin - s.ground_m
    clearance = max(0.0, above_ground) if isfinite(above_ground) else -1.0
    terrain = above_ground if isfinite(above_ground) else -1001.0  # below -1000 is unknown
    return (s.time_us, above_sea, above_sea, above_origin, s.height_above_home_m, terrain, clearance)


def vfr_hud(s: TelemetrySnapshot) -> Fields:
    """VFR_HUD (74): m/s, degrees, percent, m."""
    east, north, up = s.velocity_enu_m_s
    throttle = PERCENT * sum(s.controls) / len(s.controls)
    altitude_m = s.position_enu_m[2] + s.origin.altitude_m
    _, _, yaw = euler_from_quaternion(s.attitude)
    return (s.airspeed_m_s, hypot(east, north), compass_cdeg(yaw) / 100, throttle, altitude_m, up)


def distance_sensor(s: TelemetrySnapshot) -> Fields:
    """DISTANCE_SENSOR (132): height above ground, cm, of a downward sensor."""
    height_cm = max(0.0, 100.0 * (s.position_enu_m[2] - s.ground_m))
    sensor = (mav.MAV_DISTANCE_SENSOR_LASER, 0, mav.MAV_SENSOR_ROTATION_PITCH_270, 0)
    return (s.boot_ms, *RANGE_CM, height_cm, *sensor, 0.0, 0.0, (0.0,) * 4, PERCENT)


def wind_cov(s: TelemetrySnapshot) -> Fields | None:
    """WIND_COV (231): velocity of the air, NED, m/s; sent once estimated."""
    if not all(map(isfinite, s.wind_enu_m_s)):
        return None
    altitude_m = s.position_enu_m[2] + s.origin.altitude_m
    return (s.time_us, *ned_from_enu(s.wind_enu_m_s), nan, nan, altitude_m, 0.0, 0.0)
