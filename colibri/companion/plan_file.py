"""Read a mission of QGroundControl (.plan) as waypoints of one track.

Format: https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html.
"""

import json
from collections.abc import Iterator
from math import dist, radians
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from colibri.autopilot.guidance.trajectories.waypoint_file import DEFAULT_SPEED_M_S, MIN_LEG_S, Waypoints, leg_times
from colibri.common.earth.geodesy import Geodetic, enu_of
from colibri.common.errors import shown
from colibri.common.files import read_text
from colibri.common.types import Vector
from colibri.companion.stack import CompanionError
from colibri.companion.vehicle_peer import LocalOrigin
from colibri.mavlink.wire.dialect import mav
from colibri.mavlink.wire.places import misplaced

SUFFIX = ".plan"
_EAST_DEG = 90.0
_MOST = 1e6  # limit of numbers, and of the mission's duration in seconds
_RELATIVE = (mav.MAV_FRAME_GLOBAL_RELATIVE_ALT, mav.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
_ENDS = {mav.MAV_CMD_NAV_LAND: "landing", mav.MAV_CMD_NAV_RETURN_TO_LAUNCH: "return"}


class PlannedPoint(NamedTuple):
    """A waypoint; `item` counts from 1, without a heading it looks along the path."""

    item: int
    latitude_deg: float
    longitude_deg: float
    above_home_m: float
    heading_deg: float | None

    def enu_m(self, home: LocalOrigin) -> Vector:
        level = home.origin.altitude_m
        east, north, _ = enu_of(Geodetic(self.latitude_deg, self.longitude_deg, level), home.origin)
        return (east, north, home.up_m + self.above_home_m)


class MissionPlan(NamedTuple):
    """A mission; `note` names items left to the pilot."""

    path: Path
    points: tuple[PlannedPoint, ...]
    speed_m_s: float
    takeoff_m: float | None
    planned_home: LocalOrigin
    note: str

    def waypoints(self, home: LocalOrigin) -> Waypoints:
        """Convert the points to the vehicle's local frame."""
        places = [point.enu_m(home) for point in self.points]
        for point, before, place in zip(self.points[1:], places, places[1:], strict=False):
            if dist(before, place) < MIN_LEG_S * self.speed_m_s:
                raise _refused(self.path, point.item, "is where the waypoint before it is: leave one out")
        points, headings = np.array(places), [point.heading_deg for point in self.points]
        looks = [radians(_EAST_DEG - heading) for heading in headings if heading is not None]
        yaw = np.unwrap(looks) if len(looks) == len(points) else None
        times_s = leg_times(points, self.speed_m_s)
        if not times_s[-1] <= _MOST:
            raise CompanionError(f"{self.path}: takes {times_s[-1]:g} s: {_MOST:g} s is the longest")
        return Waypoints(self.path, times_s, points, yaw, timed=False)


def read_plan(path: Path) -> MissionPlan:
    """Read a mission; `CompanionError` if a track cannot fly it."""
    try:
        plan = json.loads(read_text(path, "utf-8-sig"))
        mission = plan["mission"]
        items, planned = mission["items"], Geodetic(*map(float, mission["plannedHomePosition"]))
        speed_m_s = float(mission.get("hoverSpeed", DEFAULT_SPEED_M_S))
    except OSError as error:
        raise CompanionError(f"{path}: {error.strerror}") from error
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError) as error:
        raise CompanionError(f"{path}: no mission of QGroundControl: save it there as .plan") from error
    if not isinstance(items, list) or misplaced(*planned[:2]) or not 0.0 < speed_m_s < float("inf"):
        raise CompanionError(f"{path}: no mission of QGroundControl: save it there as .plan")
    takeoff_m, note = None, ""
    points = []
    for number, item, command, numbers in _items(path, items):
        if command == mav.MAV_CMD_NAV_TAKEOFF and number == 1:
            takeoff_m = _height(path, number, item, numbers)
        elif command in _ENDS and number == len(items):
            note = f"{path}: item {number} ({_ENDS[command]}) is left to the pilot: the vehicle is handed over in hold"
        elif command == mav.MAV_CMD_NAV_WAYPOINT:
            points.append(_point(path, number, item, numbers))
        else:
            raise _refused(path, number, f"is no waypoint ({_name(command)}): tracks support waypoints only")
    if len(points) < 2:
        raise CompanionError(f"{path}: a track needs two waypoints, not {len(points)}")
    if len({point.heading_deg is None for point in points}) > 1:
        raise CompanionError(f"{path}: only some waypoints have a heading: set all or none")
    return MissionPlan(path, tuple(points), speed_m_s, takeoff_m, LocalOrigin(planned, 0.0), note)


def _items(path: Path, items: list[Any]) -> Iterator[tuple[int, dict[str, Any], int, list[Any]]]:
    for number, item in enumerate(items, start=1):
        kind = item.get("complexItemType", item.get("type")) if isinstance(item, dict) else None
        if kind != "SimpleItem":
            raise _refused(path, number, f"is no waypoint ({shown(kind)}): tracks support waypoints only")
        command, numbers = item.get("command"), item.get("params")
        if not isinstance(command, int) or not isinstance(numbers, list) or len(numbers) != 7:
            raise _refused(path, number, "has no command with seven parameters")
        yield number, item, command, numbers


def _point(path: Path, number: int, item: dict[str, Any], numbers: list[Any]) -> PlannedPoint:
    stay_s, latitude, longitude = (_number(path, number, numbers[n]) for n in (0, 4, 5))
    if stay_s > 0.0:
        raise _refused(path, number, f"stays for {stay_s:g} s: a track passes its waypoints, so set it to 0")
    wrong = misplaced(latitude, longitude)
    if wrong:
        raise _refused(path, number, f"is nowhere on earth: {wrong}")
    heading = None if numbers[3] is None else _number(path, number, numbers[3])
    return PlannedPoint(number, latitude, longitude, _height(path, number, item, numbers), heading)


def _height(path: Path, number: int, item: dict[str, Any], numbers: list[Any]) -> float:
    if item.get("frame") not in _RELATIVE:
        raise _refused(
            path, number, f"is not at a height above home (frame {shown(item.get('frame'))}): give it as relative"
        )
    height_m = _number(path, number, numbers[6])
    if height_m <= 0.0:
        raise _refused(path, number, f"is {height_m:g} m above home: a vehicle does not fly there")
    return height_m


def _number(path: Path, number: int, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= _MOST:
        raise _refused(path, number, f"has '{shown(value)}' where a number belongs")
    return float(value)


def _name(command: int) -> str:
    entry = mav.enums["MAV_CMD"].get(command)
    return f"command {command}" if entry is None else str(entry.name).removeprefix("MAV_CMD_")


def _refused(path: Path, number: int, what: str) -> CompanionError:
    return CompanionError(f"{path}: item {number} {what}")
