"""Items of missions and fences in metres, ENU, from the flight's origin."""

from collections.abc import Iterable, Sequence
from math import nan
from typing import NamedTuple, TypeAlias

from colibri.common.earth.geodesy import Geodetic, geodetic_of
from colibri.mavlink.mission.items import MissionItem
from colibri.mavlink.wire.dialect import mav

__tracebackhide__ = True  # a failed test shows its own lines, not these

Place: TypeAlias = tuple[float, float, float]
Corner: TypeAlias = tuple[float, float]


class Item(NamedTuple):
    """An item of a plan."""

    command: int  # MAV_CMD
    params: tuple[float, ...] = ()  # the first parameters; others are 0
    place: Place | None = None  # east, north, and height above home, m

    def on_wire(self, origin: Geodetic) -> MissionItem:
        p1, p2, p3, p4 = (*self.params, *(0.0,) * (4 - len(self.params)))
        if self.place is None:
            return MissionItem(mav.MAV_FRAME_MISSION, self.command, 1, p1, p2, p3, p4, 0, 0, 0.0)
        east, north, up = self.place
        there = geodetic_of((east, north, 0.0), origin)
        x, y = round(there.latitude_deg * 1e7), round(there.longitude_deg * 1e7)
        relative = mav.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
        return MissionItem(relative, self.command, 1, p1, p2, p3, p4, x, y, up)


def on_wire(items: Iterable[Item | MissionItem], origin: Geodetic) -> list[MissionItem]:
    """Convert items for upload; MissionItem are kept."""
    return [item.on_wire(origin) if isinstance(item, Item) else item for item in items]


def waypoint(east: float, north: float, up: float, *, stay_s: float = 0.0, within_m: float = 0.3) -> Item:
    return Item(mav.MAV_CMD_NAV_WAYPOINT, (stay_s, within_m, 0.0, nan), (east, north, up))


def takeoff(up: float, east: float = 0.0, north: float = 0.0) -> Item:
    return Item(mav.MAV_CMD_NAV_TAKEOFF, (0.0, 0.0, 0.0, nan), (east, north, up))


def land(east: float, north: float) -> Item:
    return Item(mav.MAV_CMD_NAV_LAND, (0.0, 0.0, 0.0, nan), (east, north, 0.0))


def return_home() -> Item:
    return Item(mav.MAV_CMD_NAV_RETURN_TO_LAUNCH)


def change_speed(speed_m_s: float) -> Item:
    return Item(mav.MAV_CMD_DO_CHANGE_SPEED, (1.0, speed_m_s, -1.0))


def jump(to: int, times: int) -> Item:
    return Item(mav.MAV_CMD_DO_JUMP, (float(to), float(times)))


def polygon(corners: Sequence[Corner], *, keep_out: bool = False) -> list[Item]:
    """Return the items of a polygon to stay inside of, or to `keep_out` of."""
    inside, outside = mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION, mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION
    command = outside if keep_out else inside
    return [Item(command, (float(len(corners)),), (east, north, 0.0)) for east, north in corners]


def circle(radius_m: float, centre: Corner = (0.0, 0.0), *, keep_out: bool = False) -> list[Item]:
    inside, outside = mav.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, mav.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION
    return [Item(outside if keep_out else inside, (radius_m,), (*centre, 0.0))]
