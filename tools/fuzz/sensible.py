"""Commands that a vehicle may accept, by an independent table."""

from collections.abc import Callable, Mapping
from math import isfinite, isnan, nan, pi
from typing import Any, NamedTuple

from colibri.common.earth.geodesy import is_on_earth
from colibri.mavlink.wire.dialect import mav

NOT_GIVEN = 2**31 - 1
MAX_SPEED_M_S = 25.0
"""The most that parameter MPC_XY_VEL_MAX can be."""
_WITHOUT_PLACE = mav.MAV_FRAME_MISSION


class CommandParameters(NamedTuple):
    """Parameters of a command; x and y in degrees, nan if missing."""

    p1: float
    p2: float
    p3: float
    p4: float
    x: float
    y: float
    z: float


def asked(fields: Mapping[str, Any]) -> CommandParameters:
    p1, p2, p3, p4 = (fields[f"param{number}"] for number in range(1, 5))
    if "x" not in fields:
        return CommandParameters(p1, p2, p3, p4, fields["param5"], fields["param6"], fields["param7"])
    unknown = fields["frame"] == _WITHOUT_PLACE
    x, y = (nan if unknown or value == NOT_GIVEN else value * 1e-7 for value in (fields["x"], fields["y"]))
    return CommandParameters(p1, p2, p3, p4, x, y, fields["z"])


def _nan_or(value: float, allowed: Callable[[float], bool]) -> bool:
    return isnan(value) or allowed(value)


def _one_of(*allowed: float) -> Callable[[float], bool]:
    return lambda value: value in allowed


def _whole(minimum: int, maximum: int) -> Callable[[float], bool]:
    return lambda value: minimum <= value <= maximum and value == int(value)


def _speed(value: float) -> bool:
    return 0.0 < value <= MAX_SPEED_M_S


def _place(a: CommandParameters) -> bool:
    nowhere = isnan(a.x) and isnan(a.y)
    return (nowhere or is_on_earth(a.x, a.y)) and _nan_or(a.z, lambda z: abs(z) < 20_000.0)


SENSIBLE: Mapping[int, Callable[[CommandParameters], bool]] = {
    mav.MAV_CMD_COMPONENT_ARM_DISARM: lambda a: a.p1 in (0.0, 1.0),
    mav.MAV_CMD_DO_SET_MODE: lambda a: _whole(1, 255)(a.p1) and _whole(1, 255)(a.p2) and _nan_or(a.p3, _whole(0, 255)),
    mav.MAV_CMD_NAV_TAKEOFF: lambda a: _nan_or(a.z, lambda z: abs(z) < 20_000.0),
    mav.MAV_CMD_DO_REPOSITION: lambda a: (
        _nan_or(a.p1, lambda v: v in (-1.0, 0.0) or _speed(v))
        and _nan_or(a.p2, _one_of(0.0, 1.0))
        and _nan_or(a.p4, lambda yaw: abs(yaw) <= 4.0 * pi)
        and _place(a)
    ),
    mav.MAV_CMD_DO_ORBIT: lambda a: (
        _nan_or(a.p1, lambda r: 1.0 <= abs(r) <= 1e5)
        and _nan_or(a.p2, lambda v: _speed(abs(v)))
        and _nan_or(a.p3, _whole(0, 5))
        and _place(a)
    ),
    mav.MAV_CMD_DO_CHANGE_SPEED: lambda a: _nan_or(a.p1, _one_of(0.0, 1.0)) and (a.p2 in (-1.0, -2.0) or _speed(a.p2)),
    mav.MAV_CMD_DO_SET_HOME: lambda a: a.p1 == 1.0 or (is_on_earth(a.x, a.y) and isfinite(a.z)),
    mav.MAV_CMD_DO_SET_GLOBAL_ORIGIN: lambda a: is_on_earth(a.x, a.y) and abs(a.z) <= 20_000.0,
    mav.MAV_CMD_DO_FLIGHTTERMINATION: lambda a: a.p1 == 1.0,
    mav.MAV_CMD_CONDITION_YAW: lambda a: abs(a.p1) <= 360.0 and _nan_or(a.p3, _one_of(-1.0, 0.0, 1.0)),
    mav.MAV_CMD_DO_PAUSE_CONTINUE: lambda a: a.p1 in (0.0, 1.0),
    mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: lambda a: a.p1 in (1.0, 2.0),
    mav.MAV_CMD_PREFLIGHT_STORAGE: lambda a: a.p1 in (0.0, 1.0, 2.0),
    mav.MAV_CMD_PREFLIGHT_CALIBRATION: lambda a: all(_nan_or(p, _one_of(0.0, 1.0, 2.0)) for p in a),
    mav.MAV_CMD_INJECT_FAILURE: lambda a: _whole(0, 255)(a.p1) and _whole(0, 255)(a.p2),
    mav.MAV_CMD_SET_MESSAGE_INTERVAL: lambda a: _whole(0, 2**24)(a.p1) and not isnan(a.p2),
    mav.MAV_CMD_GET_MESSAGE_INTERVAL: lambda a: _whole(0, 2**24)(a.p1),
    mav.MAV_CMD_REQUEST_MESSAGE: lambda a: _whole(0, 2**24)(a.p1),
    mav.MAV_CMD_DO_SET_MISSION_CURRENT: lambda a: _whole(-1, 65535)(a.p1) and _nan_or(a.p2, _one_of(0.0, 1.0)),
    mav.MAV_CMD_DO_SET_STANDARD_MODE: lambda a: _whole(1, 8)(a.p1),
}
"""By MAV_CMD: whether such parameters make sense."""
HARMLESS: tuple[int, ...] = (
    mav.MAV_CMD_NAV_LAND,
    mav.MAV_CMD_NAV_RETURN_TO_LAUNCH,
    mav.MAV_CMD_NAV_LOITER_UNLIM,
    mav.MAV_CMD_MISSION_START,
    mav.MAV_CMD_RUN_PREARM_CHECKS,
    mav.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
    mav.MAV_CMD_REQUEST_PROTOCOL_VERSION,
    mav.MAV_CMD_REQUEST_CAMERA_INFORMATION,
)
COMMANDS: tuple[int, ...] = (*SENSIBLE, *HARMLESS)
