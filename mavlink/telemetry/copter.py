"""Messages that ArduPilot sends beside the common ones, as GCS_Common.cpp and ardupilotmega.xml have them."""

from math import degrees, hypot, isfinite, isnan

from colibri.common.earth.geodesy import geodetic_of
from colibri.common.kernels import atan2
from colibri.mavlink.node.service import Fields
from colibri.mavlink.telemetry import controller, sensors, status
from colibri.mavlink.telemetry.attitude import angles_frd
from colibri.mavlink.telemetry.encoder import Encoder, degrees_e7, fitted
from colibri.mavlink.telemetry.snapshot import TelemetrySnapshot
from colibri.mavlink.telemetry.status import ESTIMATED
from colibri.mavlink.wire.dialect import mav
from colibri.mavlink.wire.ned import ned_frd_from_enu_flu, ned_from_enu

_STABILIZE, _ALT_HOLD = 0, 2
_SERVO_MV, _BOARD_MV = 0, 5000
_NO_RSSI = 255
_CHANNELS = 18
_PLACE_ONLY = 0xFDF8
_ATTITUDE, _PLACE = 1, 8 | 16 | 256 | 512
_CONSTANT_POSITION, _UNINITIALISED = 128, 1024
_ESTIMATOR = {1: _ATTITUDE, 2: 2, 4: 4, 8: 8 | 256, 16: 16 | 512, 32: 32}
"""Flags of EKF_STATUS_REPORT by those of ESTIMATOR_STATUS."""


def ekf_status_report(s: TelemetrySnapshot) -> Fields:
    """EKF_STATUS_REPORT (193): flags, and test ratios of velocity, position, height, compass, terrain."""
    flags = ESTIMATED if s.estimator is None else s.estimator.flags
    if not all(map(isfinite, (*s.position_enu_m, *s.attitude))):
        return (_UNINITIALISED, *(0.0,) * 5)
    report = sum(bits for flag, bits in _ESTIMATOR.items() if flags & flag)
    if not s.gps_ok or not report & 16:
        report = (report & ~_PLACE & ~2) | _CONSTANT_POSITION
    ratios = (0.05,) * 4 if s.estimator is None else s.estimator.ratios[:4]
    return (report, *(min(ratio, 1.0) if isfinite(ratio) else 0.0 for ratio in ratios), 0.0)


def sys_status(s: TelemetrySnapshot) -> Fields:
    """SYS_STATUS (1), with the controls of height and position enabled by the mode."""
    present, enabled, *others = status.sys_status(s)
    if s.custom_mode == _STABILIZE:
        enabled &= ~mav.MAV_SYS_STATUS_SENSOR_Z_ALTITUDE_CONTROL
    if s.custom_mode in (_STABILIZE, _ALT_HOLD):
        enabled &= ~mav.MAV_SYS_STATUS_SENSOR_XY_POSITION_CONTROL
    return (present, enabled, *others)


def ahrs2(s: TelemetrySnapshot) -> Fields:
    """AHRS2 (178): a second attitude and place, here the first; rad, m above the sea, degE7."""
    return (*angles_frd(s), s.place.altitude_m, *degrees_e7(s.place))


def simstate(s: TelemetrySnapshot) -> Fields:
    """SIMSTATE (164): attitude, specific force, rates and place; rad, m/s2, rad/s, degE7."""
    return (*angles_frd(s), *sensors.specific_force_frd(s), *s.rate_frd, *degrees_e7(s.place))


def sim_state(s: TelemetrySnapshot) -> Fields:
    """SIM_STATE (108): as SIMSTATE, with quaternion, height above the sea, m, and velocity NED, m/s."""
    place, velocity = s.place, ned_from_enu(s.velocity_enu_m_s)
    motion = (*ned_frd_from_enu_flu(s.attitude), *angles_frd(s), *sensors.specific_force_frd(s), *s.rate_frd)
    there = (place.latitude_deg, place.longitude_deg, place.altitude_m)
    return (*motion, *there, 0.0, 0.0, *velocity, *degrees_e7(place))


def extended_sys_state(s: TelemetrySnapshot) -> Fields:
    """EXTENDED_SYS_STATE (245), as a multicopter."""
    return (mav.MAV_VTOL_STATE_MC, s.landed_state)


def wind(s: TelemetrySnapshot) -> Fields | None:
    """WIND (168): where it blows from, degrees; m/s. In the air alone; zero until it is estimated."""
    if s.landed_state == mav.MAV_LANDED_STATE_ON_GROUND:
        return None
    east, north, up = s.wind_enu_m_s
    if not all(map(isfinite, (east, north, up))):
        return (0.0, 0.0, 0.0)
    return (degrees(atan2(-east, -north)), hypot(east, north), -up)


def fence_status(s: TelemetrySnapshot) -> Fields | None:
    """FENCE_STATUS (162): breach, its count, type and time, ms; with a fence alone."""
    if not s.fence_enabled:
        return None
    return (int(s.fence_breached), s.fence_breaches, s.fence_breach_type, s.fence_breached_us // 1000)


def rc_channels(s: TelemetrySnapshot) -> Fields:
    """RC_CHANNELS (65): the radio's channels, us."""
    return (s.boot_ms, len(s.channels), *s.channels, *(0,) * (_CHANNELS - len(s.channels)), _NO_RSSI)


def rc_channels_raw(s: TelemetrySnapshot) -> Fields:
    """RC_CHANNELS_RAW (35): the first eight channels, us."""
    return (s.boot_ms, 0, *(*s.channels, *(0,) * 8)[:8], _NO_RSSI)


def position_target_local_ned(s: TelemetrySnapshot) -> Fields | None:
    """POSITION_TARGET_LOCAL_NED (85): the client's setpoint in GUIDED, with its type mask."""
    return None if s.requested is None else controller.position_target_local_ned(s._replace(setpoint=s.requested))


def position_target_global_int(s: TelemetrySnapshot) -> Fields | None:
    """POSITION_TARGET_GLOBAL_INT (87): where the vehicle goes, degE7, m above the sea."""
    if any(map(isnan, s.target_enu_m)):
        return None
    place = geodetic_of(s.target_enu_m, s.origin)
    return (s.boot_ms, mav.MAV_FRAME_GLOBAL, _PLACE_ONLY, *degrees_e7(place), place.altitude_m, *(0.0,) * 8)


_ENCODERS: dict[str, Encoder] = {
    "EKF_STATUS_REPORT": ekf_status_report,
    "SYS_STATUS": sys_status,
    "AHRS": lambda _: (0.0, 0.0, 0.0, 0.0, 0.0, 0.002, 0.002),
    "AHRS2": ahrs2,
    "SIMSTATE": simstate,
    "SIM_STATE": sim_state,
    "EXTENDED_SYS_STATE": extended_sys_state,
    "MEMINFO": lambda _: (0, 2**16 - 1),
    "POWER_STATUS": lambda _: (_BOARD_MV, _SERVO_MV, 0),
    "WIND": wind,
    "FENCE_STATUS": fence_status,
    "RC_CHANNELS": rc_channels,
    "RC_CHANNELS_RAW": rc_channels_raw,
    "POSITION_TARGET_LOCAL_NED": position_target_local_ned,
    "POSITION_TARGET_GLOBAL_INT": position_target_global_int,
    "SCALED_IMU2": sensors.scaled_imu,
    "SCALED_IMU3": sensors.scaled_imu,
}


def copter_telemetry() -> dict[str, Encoder]:
    """Return the encoder of each message by name; an encoder never raises."""
    return {name: fitted(name, encoder) for name, encoder in _ENCODERS.items()}
