"""Items of missions, unchanged between upload and download: https://mavlink.io/en/services/mission.html."""

from collections.abc import Sequence
from math import isfinite, isnan, nan
from struct import Struct
from typing import Any, NamedTuple
from zlib import crc32

from colibri.mavlink.node.service import Fields, Peer, Send
from colibri.mavlink.services.command import DEGREES, GLOBAL_FRAMES, NOT_GIVEN, command_name
from colibri.mavlink.wire.dialect import mav
from colibri.mavlink.wire.places import misplaced, misplaced_height

MISSION: int = mav.MAV_MISSION_TYPE_MISSION
FENCE: int = mav.MAV_MISSION_TYPE_FENCE
RALLY: int = mav.MAV_MISSION_TYPE_RALLY
ALL: int = mav.MAV_MISSION_TYPE_ALL
PLAN_TYPES = (MISSION, FENCE, RALLY)
_NAMES = {MISSION: "mission", FENCE: "fence", RALLY: "rally", ALL: "all plans"}

ACCEPTED: int = mav.MAV_MISSION_ACCEPTED

_FIRST_PARAMETER, _PARAMETERS, _FRAME = 3, 7, 3  # the last counts in a message
_PACKED = Struct("<BHBffffiif")
_INT32 = range(-(2**31), 2**31)


class MissionItem(NamedTuple):
    frame: int
    command: int
    autocontinue: int
    p1: float
    p2: float
    p3: float
    p4: float
    x: int  # latitude, degE7, or parameter five
    y: int  # longitude, degE7, or parameter six
    z: float  # altitude, m, or parameter seven


class StoredPlan(NamedTuple):
    """The stored items of one type; the opaque id changes with them."""

    items: tuple[MissionItem, ...] = ()
    id: int = 0


NO_PLAN = StoredPlan()


def plan_of(items: Sequence[MissionItem]) -> StoredPlan:
    """Return the plan of these items; its id is their CRC-32, never 0."""
    if not items:
        return NO_PLAN
    return StoredPlan(tuple(items), crc32(b"".join(_PACKED.pack(*item) for item in items)) or 1)


def item_of(message_name: str, fields: Any) -> MissionItem | int:
    """Return the item in a message; a MAV_MISSION_RESULT if its place fits no integer."""
    x, y = fields.x, fields.y
    if message_name == "MISSION_ITEM":
        scale = 1e7 if fields.frame in GLOBAL_FRAMES else 1.0
        x, y = _whole(x, scale), _whole(y, scale)
        if x is None:
            return int(mav.MAV_MISSION_INVALID_PARAM5_X)
        if y is None:
            return int(mav.MAV_MISSION_INVALID_PARAM6_Y)
    numbers = (fields.param1, fields.param2, fields.param3, fields.param4, x, y, fields.z)
    return MissionItem(fields.frame, fields.command, fields.autocontinue, *numbers)


def plan_name(plan_type: int) -> str:
    return _NAMES.get(plan_type, f"plan type {plan_type}")


def fault_of(item: MissionItem, result: int) -> str:
    """Name the field and value for which an item is refused with a MAV_MISSION_RESULT."""
    name = command_name(item.command)
    if result == mav.MAV_MISSION_UNSUPPORTED:
        return f"{name} is not supported"
    if result == mav.MAV_MISSION_UNSUPPORTED_FRAME:
        return f"{name} in frame {item.frame}"
    number = result - mav.MAV_MISSION_INVALID_PARAM1
    if not 0 <= number < _PARAMETERS:
        return name
    value = item[_FIRST_PARAMETER + number]
    x, y = (nan if each == NOT_GIVEN else each * DEGREES for each in (item.x, item.y))
    place = misplaced(x, y) if number in (4, 5) else ""
    height = misplaced_height(value) if number == _PARAMETERS - 1 else ""
    return f"{name}: {place or height or f'parameter {number + 1} is {value:g}'}"


def item_fields(peer: Peer, seq: int, item: MissionItem, current: bool, plan_type: int) -> Fields:
    frame, command, autocontinue, p1, p2, p3, p4, x, y, z = item
    target = (peer.system, peer.component)
    return (*target, seq, frame, command, int(current), autocontinue, p1, p2, p3, p4, x, y, z, plan_type)


def in_old_form(send: Send) -> Send:
    """Return a MISSION_ITEM_INT as MISSION_ITEM: degrees in global frames."""
    *head, x, y, z, plan_type = send.fields
    scale = DEGREES if send.fields[_FRAME] in GLOBAL_FRAMES else 1.0
    x, y = (nan if value == NOT_GIVEN else value * scale for value in (x, y))
    return send._replace(name="MISSION_ITEM", fields=(*head, x, y, z, plan_type))


def _whole(value: float, scale: float) -> int | None:
    if isnan(value):
        return NOT_GIVEN
    if not isfinite(value):
        return None
    whole = round(value * scale)
    return whole if whole in _INT32 else None


def behind(item: MissionItem, items: int) -> MissionItem:
    """Return an item moved behind `items` others, or before them if negative: a jump's target moves."""
    return item._replace(p1=item.p1 + items) if item.command == mav.MAV_CMD_DO_JUMP else item
