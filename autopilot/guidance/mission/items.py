"""Accepted mission items (https://mavlink.io/en/messages/common.html#mav_commands); nan is the default of a value."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from math import inf, isfinite, isnan
from typing import NamedTuple, TypeAlias

from colibri.common.earth.compiled_geodesy import enu_of
from colibri.common.earth.geodesy import MAX_LATITUDE_DEG, Geodetic
from colibri.common.types import Vector
from colibri.mavlink.mission.items import ACCEPTED, MissionItem
from colibri.mavlink.mission.upload import Rules
from colibri.mavlink.services.command import DEGREES, GLOBAL_FRAMES, NOT_GIVEN
from colibri.mavlink.wire.dialect import mav
from colibri.mavlink.wire.places import MAX_DISTANCE_M, MAX_HEIGHT_M, height_m, misplaced

DO_AUX_FUNCTION = 218  # of the dialect ardupilotmega
FENCE_SWITCH = 11  # function of a switch
_PAYLOAD = (
    "NAV_ROI CONDITION_DISTANCE DO_SET_RELAY DO_REPEAT_RELAY DO_SET_SERVO DO_REPEAT_SERVO DO_SET_ACTUATOR "
    "DO_RETURN_PATH_START DO_LAND_START DO_SET_ROI_LOCATION DO_SET_ROI_WPNEXT_OFFSET DO_SET_ROI_NONE "
    "DO_SET_ROI_SYSID DO_SET_ROI DO_CONTROL_VIDEO DO_DIGICAM_CONFIGURE DO_DIGICAM_CONTROL DO_MOUNT_CONFIGURE "
    "DO_MOUNT_CONTROL DO_MOUNT_CONTROL_QUAT DO_SET_CAM_TRIGG_DIST DO_SET_CAM_TRIGG_INTERVAL DO_TRIGGER_CONTROL "
    "DO_GRIPPER DO_WINCH DO_GIMBAL_MANAGER_PITCHYAW DO_GIMBAL_MANAGER_CONFIGURE ILLUMINATOR_ON_OFF "
    "DO_ILLUMINATOR_CONFIGURE OBLIQUE_SURVEY SET_CAMERA_MODE SET_CAMERA_ZOOM SET_CAMERA_FOCUS SET_CAMERA_SOURCE "
    "IMAGE_START_CAPTURE IMAGE_STOP_CAPTURE CAMERA_TRACK_POINT CAMERA_TRACK_RECTANGLE CAMERA_STOP_TRACKING "
    "VIDEO_START_CAPTURE VIDEO_STOP_CAPTURE VIDEO_START_STREAMING VIDEO_STOP_STREAMING PANORAMA_CREATE"
)
SKIPPED = frozenset[int](getattr(mav, f"MAV_CMD_{name}") for name in _PAYLOAD.split())
"""Commands to absent payload: accepted with any parameters, and skipped."""

_Check: TypeAlias = Callable[[float], bool]


def _optional(check: _Check) -> _Check:
    return lambda value: isnan(value) or check(value)


def _one_of(*allowed: float) -> _Check:
    return _optional(lambda value: value in allowed)


def _whole(minimum: int, maximum: int) -> _Check:
    return lambda value: isfinite(value) and minimum <= value <= maximum and value == int(value)


_NOT_INFINITE = _optional(isfinite)
_NOT_NEGATIVE = _optional(lambda value: 0.0 <= value < inf)
_A_RADIUS = _optional(lambda value: abs(value) <= MAX_DISTANCE_M)
_A_SPEED = _optional(lambda value: value in (-1.0, -2.0) or 0.0 < value < inf)


class _Allowed(NamedTuple):
    """Rules of one command; `here` allows 0, 0 as x and y."""

    place: bool = False
    height: bool = False
    p1: _Check = lambda _: True
    p2: _Check = lambda _: True
    p3: _Check = lambda _: True
    p4: _Check = lambda _: True
    here: bool = False


_ALLOWED: Mapping[int, _Allowed] = {
    mav.MAV_CMD_NAV_WAYPOINT: _Allowed(True, True, p1=_NOT_NEGATIVE, p2=_NOT_NEGATIVE, p4=_NOT_INFINITE),
    mav.MAV_CMD_NAV_LOITER_UNLIM: _Allowed(True, True, p4=_NOT_INFINITE),
    mav.MAV_CMD_NAV_LOITER_TURNS: _Allowed(True, True, p1=_NOT_NEGATIVE, p3=_A_RADIUS),
    mav.MAV_CMD_NAV_LOITER_TIME: _Allowed(True, True, p1=_NOT_NEGATIVE, p4=_NOT_INFINITE),
    mav.MAV_CMD_NAV_LOITER_TO_ALT: _Allowed(True, True),
    mav.MAV_CMD_NAV_TAKEOFF: _Allowed(True, True, p4=_NOT_INFINITE, here=True),
    mav.MAV_CMD_NAV_LAND: _Allowed(True, False, p4=_NOT_INFINITE, here=True),
    mav.MAV_CMD_NAV_RETURN_TO_LAUNCH: _Allowed(),
    mav.MAV_CMD_NAV_DELAY: _Allowed(p1=_NOT_NEGATIVE),
    mav.MAV_CMD_CONDITION_DELAY: _Allowed(p1=_NOT_NEGATIVE),
    mav.MAV_CMD_CONDITION_YAW: _Allowed(p1=isfinite, p3=_one_of(-1.0, 0.0, 1.0), p4=_one_of(0.0, 1.0)),
    mav.MAV_CMD_DO_JUMP: _Allowed(p1=_whole(0, 0xFFFF), p2=_whole(-1, 0xFFFF)),
    mav.MAV_CMD_DO_CHANGE_SPEED: _Allowed(p1=_one_of(0.0, 1.0, 2.0, 3.0), p2=_A_SPEED),
    mav.MAV_CMD_DO_SET_HOME: _Allowed(p1=_one_of(0.0, 1.0)),
}
FLOWN: frozenset[int] = frozenset(_ALLOWED)
_COPTERS_SKIPPED = (208, 212, 215, 216, 222, 223)
"""Parachute, autotune, repeated way, sprayer, limits of GUIDED, engine."""
_COPTERS: Mapping[int, _Allowed] = {  # as ArduCopter: a place of 0, 0 is where the vehicle is going
    **{command: allowed._replace(here=allowed.place) for command, allowed in _ALLOWED.items()},
    mav.MAV_CMD_NAV_SPLINE_WAYPOINT: _Allowed(True, True, here=True),
    mav.MAV_CMD_NAV_DELAY: _Allowed(p1=isfinite),
    mav.MAV_CMD_NAV_VTOL_TAKEOFF: _Allowed(True, True, here=True),
    mav.MAV_CMD_NAV_VTOL_LAND: _Allowed(True, here=True),
    mav.MAV_CMD_DO_FENCE_ENABLE: _Allowed(p1=_one_of(0.0, 1.0, 2.0)),
    **dict.fromkeys(_COPTERS_SKIPPED, _Allowed()),
    mav.MAV_CMD_JUMP_TAG: _Allowed(p1=_whole(0, 0xFFFF)),
    mav.MAV_CMD_DO_JUMP_TAG: _Allowed(p1=_whole(0, 0xFFFF), p2=_whole(-1, 0xFFFF)),
    DO_AUX_FUNCTION: _Allowed(p1=_whole(0, 0xFFFF), p2=_one_of(0.0, 1.0, 2.0)),
}
COPTERS_MAX_HEIGHT_M = 83_000.0  # AP_Common/Location.h


def check_item(item: MissionItem, table: Mapping[int, _Allowed] = _ALLOWED, max_height_m: float = MAX_HEIGHT_M) -> int:
    allowed = table.get(item.command)
    if allowed is None:
        return int(ACCEPTED if item.command in SKIPPED else mav.MAV_MISSION_UNSUPPORTED)
    if item.command == mav.MAV_CMD_DO_SET_HOME and item.p1 != 1.0:
        allowed = allowed._replace(place=True, height=True)
    here = allowed.here and is_here(item)
    placeless = not allowed.height and (here or not allowed.place)
    if item.frame not in GLOBAL_FRAMES and not (placeless and item.frame == mav.MAV_FRAME_MISSION):
        return int(mav.MAV_MISSION_UNSUPPORTED_FRAME)
    checks = (allowed.p1, allowed.p2, allowed.p3, allowed.p4)
    for index, (check, value) in enumerate(zip(checks, (item.p1, item.p2, item.p3, item.p4), strict=True)):
        if not check(value):
            return int(mav.MAV_MISSION_INVALID_PARAM1) + index
    if allowed.place and not here:
        result = check_place(item)
        if result != ACCEPTED:
            return result
    return check_height(item, max_height_m) if allowed.height else ACCEPTED


def check_mission(items: Sequence[MissionItem]) -> tuple[int, int]:
    """Check that jumps lead to an item."""
    tags = jump_tags(items)
    for seq, item in enumerate(items):
        outside = item.command == mav.MAV_CMD_DO_JUMP and item.p1 >= len(items)
        if outside or (item.command == mav.MAV_CMD_DO_JUMP_TAG and item.p1 not in tags):
            return int(mav.MAV_MISSION_INVALID_PARAM1), seq
    return ACCEPTED, 0


def jump_tags(items: Sequence[MissionItem]) -> dict[float, int]:
    """Return the first item of each tag."""
    tagged = [(item.p1, seq) for seq, item in enumerate(items) if item.command == mav.MAV_CMD_JUMP_TAG]
    return dict(reversed(tagged))


def check_rally_item(item: MissionItem) -> int:
    if item.command != mav.MAV_CMD_NAV_RALLY_POINT:
        return int(mav.MAV_MISSION_UNSUPPORTED)
    if item.frame not in GLOBAL_FRAMES:
        return int(mav.MAV_MISSION_UNSUPPORTED_FRAME)
    return check_place(item) or check_height(item)


def check_place(item: MissionItem) -> int:
    if not misplaced(item.x * DEGREES, item.y * DEGREES):
        return ACCEPTED
    on_earth = abs(item.x * DEGREES) <= MAX_LATITUDE_DEG and (item.x or item.y)
    return int(mav.MAV_MISSION_INVALID_PARAM6_Y if on_earth else mav.MAV_MISSION_INVALID_PARAM5_X)


def check_height(item: MissionItem, max_m: float = MAX_HEIGHT_M) -> int:
    return int(ACCEPTED if abs(item.z) <= max_m else mav.MAV_MISSION_INVALID_PARAM7)


def is_here(item: MissionItem) -> bool:
    """Whether an item has no place; ground stations send 0, 0."""
    return (item.x == 0 and item.y == 0) or NOT_GIVEN in (item.x, item.y)


def place_of(item: MissionItem, home_enu_m: Vector, origin: Geodetic) -> Vector:
    x, y, _ = enu_of(Geodetic(item.x * DEGREES, item.y * DEGREES, 0.0), origin)
    return (x, y, height_of(item, home_enu_m, origin))


def height_of(item: MissionItem, home_enu_m: Vector, origin: Geodetic) -> float:
    """Return the height of an item, z of ENU, m; by default home's."""
    if not isfinite(item.z):
        return home_enu_m[2]
    return height_m(item.z, item.frame, home_enu_m[2], origin)


def places(items: Sequence[MissionItem], home_enu_m: Vector, origin: Geodetic) -> Iterator[tuple[int, Vector]]:
    """Yield sequence number and place, m, ENU, of destinations."""
    for seq, item in enumerate(items):
        allowed = _COPTERS.get(item.command)
        if allowed is None or not (allowed.place or (item.command == mav.MAV_CMD_DO_SET_HOME and item.p1 != 1.0)):
            continue
        if not is_here(item):
            yield seq, place_of(item, home_enu_m, origin)
        elif allowed.height and (item.z or item.command == mav.MAV_CMD_NAV_TAKEOFF):
            yield seq, (home_enu_m[0], home_enu_m[1], height_of(item, home_enu_m, origin))


def rally_places(items: Sequence[MissionItem], home_enu_m: Vector, origin: Geodetic) -> Iterator[tuple[int, Vector]]:
    return ((seq, place_of(item, home_enu_m, origin)) for seq, item in enumerate(items))


MISSION_RULES = Rules(check_item, check_mission)
COPTER_RULES = Rules(partial(check_item, table=_COPTERS, max_height_m=COPTERS_MAX_HEIGHT_M), check_mission)
RALLY_RULES = Rules(check_rally_item, lambda _: (ACCEPTED, 0))
