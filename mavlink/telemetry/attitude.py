"""Messages of attitude, rates and the full state."""

from math import nan

from colibri.common.compiled_rotations import euler_from_quaternion
from colibri.common.types import Vector
from colibri.mavlink.node.service import Fields
from colibri.mavlink.telemetry.encoder import MILLI_G, degrees_e7, in_body_frd, times, yaw_ned
from colibri.mavlink.telemetry.snapshot import TelemetrySnapshot
from colibri.mavlink.wire.dialect import mav
from colibri.mavlink.wire.ned import ned_frd_from_enu_flu, ned_from_enu

_FULL_QUALITY_PERCENT = 100
_COVARIANCE_UNKNOWN = (nan,) + (0.0,) * 20


def angles_frd(s: TelemetrySnapshot) -> Vector:
    roll, pitch, yaw = euler_from_quaternion(s.attitude)
    return (roll, -pitch, yaw_ned(yaw))


def attitude(s: TelemetrySnapshot) -> Fields:
    """ATTITUDE (30): Euler angles NED/FRD in rad; rates rad/s."""
    return (s.boot_ms, *angles_frd(s), *s.rate_frd)


def attitude_quaternion(s: TelemetrySnapshot) -> Fields:
    """ATTITUDE_QUATERNION (31): NED/FRD, wxyz."""
    return (s.boot_ms, *ned_frd_from_enu_flu(s.attitude), *s.rate_frd)


def odometry(s: TelemetrySnapshot) -> Fields:
    """ODOMETRY (331): pose in NED, velocity and rates in the body's FRD."""
    pose = (*ned_from_enu(s.position_enu_m), ned_frd_from_enu_flu(s.attitude))
    twist = (*in_body_frd(s.attitude, s.velocity_enu_m_s), *s.rate_frd)
    frames = (mav.MAV_FRAME_LOCAL_NED, mav.MAV_FRAME_BODY_FRD)
    quality = (0, mav.MAV_ESTIMATOR_TYPE_AUTOPILOT, _FULL_QUALITY_PERCENT)
    return (s.time_us, *frames, *pose, *twist, _COVARIANCE_UNKNOWN, _COVARIANCE_UNKNOWN, *quality)


def hil_state_quaternion(s: TelemetrySnapshot) -> Fields:
    """HIL_STATE_QUATERNION (115), the ground truth: coordinate acceleration, mG, FRD."""
    place = s.place
    where = (*degrees_e7(place), 1e3 * place.altitude_m, *s.velocity_ned_cm_s)
    air = 100.0 * s.airspeed_m_s
    acceleration = times(MILLI_G, in_body_frd(s.attitude, s.acceleration_enu_m_s2))
    return (s.time_us, ned_frd_from_enu_flu(s.attitude), *s.rate_frd, *where, air, air, *acceleration)
