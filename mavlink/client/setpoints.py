"""Setpoints and sticks from SI, ENU and FLU to the wire: messages of common.xml."""

from math import pi

from colibri.common.types import Quaternion, Vector
from colibri.mavlink.client.conversation import Encoded, Target
from colibri.mavlink.wire.dialect import bits, mav
from colibri.mavlink.wire.ned import frd_from_flu, ned_frd_from_enu_flu, ned_from_enu

_GROUPS = [bits("POSITION_TARGET_TYPEMASK_", f"{of}X_IGNORE {of}Y_IGNORE {of}Z_IGNORE") for of in ("", "V", "A")]
_NO_YAW = bits("POSITION_TARGET_TYPEMASK_", "YAW_IGNORE")
_NO_YAW_RATE = bits("POSITION_TARGET_TYPEMASK_", "YAW_RATE_IGNORE")
_NO_ATTITUDE = bits("ATTITUDE_TARGET_TYPEMASK_", "ATTITUDE_IGNORE")
_NO_RATES = bits("ATTITUDE_TARGET_TYPEMASK_", "BODY_ROLL_RATE_IGNORE BODY_PITCH_RATE_IGNORE BODY_YAW_RATE_IGNORE")
_LEVEL: Quaternion = (1.0, 0.0, 0.0, 0.0)
_STILL: Vector = (0.0, 0.0, 0.0)


def position_target(
    target: Target,
    position: Vector | None = None,
    velocity: Vector | None = None,
    acceleration: Vector | None = None,
    yaw: float | None = None,
    yaw_rate: float | None = None,
    *,
    time_us: int = 0,
) -> Encoded:
    """Return a setpoint in SI, local ENU; missing groups are masked."""
    groups = (position, velocity, acceleration)
    mask = sum(ignored for ignored, group in zip(_GROUPS, groups, strict=True) if group is None)
    mask |= _NO_YAW * (yaw is None) | _NO_YAW_RATE * (yaw_rate is None)
    ned = [value for group in groups for value in ned_from_enu(group or _STILL)]
    heading = 0.0 if yaw is None else 0.5 * pi - yaw
    fields = (_ms(time_us), *target, mav.MAV_FRAME_LOCAL_NED, mask, *ned, heading, -(yaw_rate or 0.0))
    return "SET_POSITION_TARGET_LOCAL_NED", fields


def attitude_target(
    target: Target, attitude: Quaternion | None = None, rates: Vector | None = None, *, thrust: float, time_us: int = 0
) -> Encoded:
    """Return an attitude (FLU to ENU) or body rates (FLU, rad/s); missing ones are masked."""
    mask = _NO_ATTITUDE * (attitude is None) | _NO_RATES * (rates is None)
    q = _LEVEL if attitude is None else ned_frd_from_enu_flu(attitude)
    return "SET_ATTITUDE_TARGET", (_ms(time_us), *target, mask, q, *frd_from_flu(rates or _STILL), thrust)


def manual_control(
    system: int, pitch: float = 0.0, roll: float = 0.0, thrust: float = 0.5, yaw: float = 0.0
) -> Encoded:
    """Return stick positions: forward, right, up (0..1), clockwise, the others -1..1."""
    return "MANUAL_CONTROL", (system, *(round(1000.0 * axis) for axis in (pitch, roll, thrust, yaw)), 0)


def _ms(time_us: int) -> int:
    return time_us // 1000 & 0xFFFFFFFF
