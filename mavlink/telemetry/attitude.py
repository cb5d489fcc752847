"""Messages of attitude, rates and the full state."""

from math import nan

from colibri.common.compiled_rotations import euler_from_quaternion
from colibri.mavlink.node.service import Fields
from colibri.mavlink.telemetry.encoder import (
    MILLI_G,
    airspeed_m_s,
    boot_ms,
    degrees_e7,
    in_body_frd,
    place_of,
    rate_frd,
    times,
    velocity_ned_cm_s,
    yaw_ned,
)
from colibri.mavlink.telemetry.snapshot import TelemetrySnapshot
from colibri.mavlink.wire.dialect import mav
from colibri.mavlink.wire.ned import ned_frd_from_enu_flu, ned_from_enu

FULL_QUALITY_PERCENT = 100
COVARIANCE_UNKNOWN = (nan,) + (0.0,) * 20


def attitude(s: TelemetrySnapshot) -> Fields:
    """ATTITUDE (30): Euler angles NED/FRD in rad; rates rad/s."""
    roll, pitch, yaw = euler_from_quaternion(s.attitude)
    return (boot_ms(s), roll, -pitch, yaw_ned(yaw), *rate_frd(s))


def attitude_quaternion(s: TelemetrySnapshot) -> Fields:
    """ATTITUDE_QUATERNION (31): NED/FRD, wxyz."""
    return (boot_ms(s), *ned_frd_from_enu_flu(s.attitude), *rate_frd(s))


def odometry(s: TelemetrySnapshot) -> Fields:
    """ODOMETRY (331): pose in NED, velocity and rates in the body's FRD."""
    pose = (*ned_from_enu(s.position_enu_m), ned_frd_from_enu_flu(s.attitude))
    twist = (*in_body_frd(s.attitude, s.velocity_enu_m_s), *rate_frd(s))
    frames = (mav.MAV_FRAME_LOCAL_NED, mav.MAV_FRAME_BODY_FRD)
    quality = (0, mav.MAV_ESTIMATOR_TYPE_AUTOPILOT, FULL_QUALITY_PERCENT)
    return (s.time_us, *frames, *pose, *twist, COVARIANCE_UNKNOWN, COVARIANCE_UNKNOWN, *quality)


def hil_state_quaternion(s: TelemetrySnapshot) -> Fields:
    """HIL_STATE_QUATERNION (115), the ground truth: coordinate acceleration, mG, FRD."""
    place = place_of(s)
    where = (*degrees_e7(place), 1e3 * place.altitude_m, *velocity_ned_cm_s(s))
    air = 100.0 * airspeed_m_s(s)
    acceleration = times(MILLI_G, in_body_frd(s.attitude, s.acceleration_enu_m_s2))
    return (s.time_us, ned_frd_from_enu_flu(s.attitude), *rate_frd(s), *where, air, air, *acceleration)
