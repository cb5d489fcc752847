"""Setpoints on the wire: body rates or an attitude with a thrust; position or velocity where nothing else is taken.

Field layouts: common.xml, ATTITUDE_TARGET_TYPEMASK and POSITION_TARGET_TYPEMASK.
"""

from math import pi
from typing import Any

from colibri.autopilot.control.interface import Horizon
from colibri.common.rotations import quaternion_from_euler
from colibri.common.types import Vector
from colibri.mavlink.wire.dialect import bits, mav
from colibri.mavlink.wire.ned import frd_from_flu, ned_frd_from_enu_flu, ned_from_enu

_RATES = bits("ATTITUDE_TARGET_TYPEMASK_", "ATTITUDE_IGNORE")
_ATTITUDE = bits("ATTITUDE_TARGET_TYPEMASK_", "BODY_ROLL_RATE_IGNORE BODY_PITCH_RATE_IGNORE BODY_YAW_RATE_IGNORE")
_NO_POSITION = bits("POSITION_TARGET_TYPEMASK_", "X_IGNORE Y_IGNORE Z_IGNORE")
_NO_ACCELERATION = bits("POSITION_TARGET_TYPEMASK_", "AX_IGNORE AY_IGNORE AZ_IGNORE")
_NO_YAW_RATE = bits("POSITION_TARGET_TYPEMASK_", "YAW_RATE_IGNORE")
_LEVEL = (1.0, 0.0, 0.0, 0.0)
_PULL_1_S = 1.0
"""How fast a velocity setpoint has an error of position die."""

Target = tuple[int, int]
Encoded = tuple[str, tuple[Any, ...]]
"""Name and fields of a message."""


def rates(now_us: int, target: Target, rate_flu_rad_s: Vector, thrust: float) -> Encoded:
    """Return body rates and a thrust of 0..1."""
    return "SET_ATTITUDE_TARGET", (_ms(now_us), *target, _RATES, _LEVEL, *frd_from_flu(rate_flu_rad_s), thrust)


def attitude(now_us: int, target: Target, euler: Vector, thrust: float) -> Encoded:
    """Return an attitude, phi, theta, psi, FLU to ENU, and a thrust of 0..1."""
    q = ned_frd_from_enu_flu(quaternion_from_euler(*euler))
    return "SET_ATTITUDE_TARGET", (_ms(now_us), *target, _ATTITUDE, q, 0.0, 0.0, 0.0, thrust)


def position(now_us: int, target: Target, reference: Horizon) -> Encoded:
    """Return the first of the references, with velocity and acceleration fed forward."""
    return _local(now_us, target, _NO_YAW_RATE, reference, _first(reference.velocity_enu_m_s))


def velocity(now_us: int, target: Target, reference: Horizon, position_enu_m: Vector) -> Encoded:
    """Return the velocity of the first reference, and what brings the vehicle there."""
    places, velocities = _first(reference.position_enu_m), _first(reference.velocity_enu_m_s)
    x, y, z = (v + _PULL_1_S * (p - at) for v, p, at in zip(velocities, places, position_enu_m, strict=True))
    return _local(now_us, target, _NO_POSITION | _NO_ACCELERATION | _NO_YAW_RATE, reference, (x, y, z))


def _local(now_us: int, target: Target, mask: int, reference: Horizon, velocity_enu_m_s: Vector) -> Encoded:
    place, acceleration = _first(reference.position_enu_m), _first(reference.acceleration_enu_m_s2)
    motion = (*ned_from_enu(place), *ned_from_enu(velocity_enu_m_s), *ned_from_enu(acceleration))
    heading = 0.5 * pi - float(reference.yaw_rad[0])
    fields = (_ms(now_us), *target, mav.MAV_FRAME_LOCAL_NED, mask, *motion, heading, 0.0)
    return "SET_POSITION_TARGET_LOCAL_NED", fields


def _first(rows: Any) -> Vector:
    x, y, z = rows[0].tolist()
    return (x, y, z)


def _ms(now_us: int) -> int:
    return now_us // 1000 & 0xFFFFFFFF
