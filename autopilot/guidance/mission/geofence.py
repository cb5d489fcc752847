"""The geofence: polygons and circles.

Items: https://mavlink.io/en/messages/common.html#MAV_CMD_NAV_FENCE_RETURN_POINT and following. The vehicle must be
inside all inclusion zones of one group (parameter 2), and outside all exclusion zones. Circles of radius 0 are
placeholders.
"""

from collections.abc import Iterable, Iterator, Sequence
from math import hypot, inf, isfinite, isnan
from typing import NamedTuple, TypeAlias

import numpy as np

from colibri.autopilot.guidance.mission.items import MAX_DISTANCE_M, check_place
from colibri.common.earth.geodesy import Geodetic, enu_of
from colibri.common.types import Array, Vector
from colibri.mavlink.mission.items import ACCEPTED, MissionItem
from colibri.mavlink.mission.upload import Rules
from colibri.mavlink.services.command import DEGREES, GLOBAL_FRAMES
from colibri.mavlink.wire.dialect import mav
from colibri.mavlink.wire.refusal import Refusal

RETURN_POINT: int = mav.MAV_CMD_NAV_FENCE_RETURN_POINT
POLYGONS: tuple[int, ...] = (
    mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
    mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
)
CIRCLES: tuple[int, ...] = (mav.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, mav.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION)
INCLUSIONS: tuple[int, ...] = (POLYGONS[0], CIRCLES[0])
FEWEST_VERTICES = 3
EDGE_M = 1e-6
"""Tolerance for points on an edge, which count as inside."""


def check_fence_item(item: MissionItem) -> int:
    if item.command not in (RETURN_POINT, *POLYGONS, *CIRCLES):
        return int(mav.MAV_MISSION_UNSUPPORTED)
    if item.frame not in GLOBAL_FRAMES:
        return int(mav.MAV_MISSION_UNSUPPORTED_FRAME)
    if item.command in POLYGONS and not (item.p1 >= FEWEST_VERTICES and isfinite(item.p1) and item.p1 == int(item.p1)):
        return int(mav.MAV_MISSION_INVALID_PARAM1)
    if item.command in CIRCLES and not 0.0 <= item.p1 <= MAX_DISTANCE_M:
        return int(mav.MAV_MISSION_INVALID_PARAM1)
    if item.command in INCLUSIONS and not (isnan(item.p2) or isfinite(item.p2)):
        return int(mav.MAV_MISSION_INVALID_PARAM2)
    return check_place(item)


def check_fence(items: Sequence[MissionItem]) -> int:
    """Check that polygons are complete, of one kind and group."""
    for vertices in _zones(items):
        first = vertices[0]
        if len(vertices) < _length(first) or any((v.command, v.p1) != (first.command, first.p1) for v in vertices[1:]):
            return int(mav.MAV_MISSION_INVALID_PARAM1)
        if first.command == POLYGONS[0] and any(_group(v) != _group(first) for v in vertices):
            return int(mav.MAV_MISSION_INVALID_PARAM2)
    return ACCEPTED


FENCE_RULES = Rules(check_fence_item, check_fence)


class Disc(NamedTuple):
    """The inside of a circle."""

    east_m: float
    north_m: float
    radius_m: float

    def depth_m(self, east_m: float, north_m: float) -> float:
        """Return the depth inside, m; negative outside."""
        return self.radius_m - hypot(east_m - self.east_m, north_m - self.north_m)


class Polygon:
    """The inside of a polygon, by the even-odd rule."""

    def __init__(self, vertices_m: Iterable[tuple[float, float]]) -> None:
        self._from: Array = np.array(list(vertices_m), dtype=float)
        self._to = np.roll(self._from, -1, axis=0)
        self._along = self._to - self._from
        squared = (self._along * self._along).sum(axis=1)
        self._squared = np.where(squared > 0.0, squared, 1.0)

    def depth_m(self, east_m: float, north_m: float) -> float:
        to = np.array((east_m, north_m)) - self._from  # each edge's start to the point
        part = np.clip((to * self._along).sum(axis=1) / self._squared, 0.0, 1.0)
        away = to - part[:, None] * self._along
        nearest = float(np.sqrt((away * away).sum(axis=1).min()))
        # An edge is crossed where just one of its ends is north of the point. Both edges of a corner compare the same
        # two numbers, so that a ray through it crosses once or not at all, however they round.
        starts, ends = self._from[:, 1] > north_m, self._to[:, 1] > north_m
        side = self._along[:, 0] * to[:, 1] - self._along[:, 1] * to[:, 0]
        crossed = (starts != ends) & ((side > 0.0) == (self._along[:, 1] > 0.0))
        return nearest if np.count_nonzero(crossed) % 2 else -nearest


Zone: TypeAlias = Disc | Polygon


class Geofence:
    """A fence in ENU, m; return points are accepted, and ignored."""

    def __init__(self, items: Sequence[MissionItem], origin: Geodetic) -> None:
        self._groups: dict[float, list[Zone]] = {}
        self._exclusions: list[Zone] = []
        for zone in _zones(items):
            self._add(zone[0], [_place(item, origin) for item in zone])

    def _add(self, item: MissionItem, places: Sequence[tuple[float, float]]) -> None:
        if item.command == RETURN_POINT or (item.command in CIRCLES and item.p1 == 0.0):
            return
        zone: Zone = Polygon(places) if item.command in POLYGONS else Disc(*places[0], item.p1)
        if item.command in INCLUSIONS:
            self._groups.setdefault(_group(item), []).append(zone)
        else:
            self._exclusions.append(zone)

    def margin_m(self, position_enu_m: Vector) -> float:
        """Return the depth inside, m; negative outside."""
        east, north, up = position_enu_m
        if not (isfinite(east) and isfinite(north) and isfinite(up)):
            return -inf
        groups = (min(zone.depth_m(east, north) for zone in zones) for zones in self._groups.values())
        return min(max(groups, default=inf), *(-zone.depth_m(east, north) for zone in self._exclusions), inf)

    def refusal(self, position_enu_m: Vector) -> Refusal | None:
        return None if self.margin_m(position_enu_m) >= -EDGE_M else Refusal("outside the geofence")


class AroundHome(NamedTuple):
    """The parameters' fence around home; 0 for off."""

    home_enu_m: Vector
    max_distance_m: float
    max_height_m: float

    def margin_m(self, position_enu_m: Vector) -> float:
        """Return the depth inside, m; negative outside."""
        east, north, up = (place - home for place, home in zip(position_enu_m, self.home_enu_m, strict=True))
        if not (isfinite(east) and isfinite(north) and isfinite(up)):
            return -inf
        away_m = self.max_distance_m - hypot(east, north) if self.max_distance_m > 0.0 else inf
        return min(away_m, self.max_height_m - up) if self.max_height_m > 0.0 else away_m

    def refusal(self, position_enu_m: Vector) -> Refusal | None:
        if self.margin_m(position_enu_m) >= -EDGE_M:
            return None
        too_high = 0.0 < self.max_height_m < position_enu_m[2] - self.home_enu_m[2]
        return Refusal(
            f"more than {self.max_height_m:g} m above home"
            if too_high
            else f"more than {self.max_distance_m:g} m from home"
        )


def _zones(items: Sequence[MissionItem]) -> Iterator[Sequence[MissionItem]]:
    at = 0
    while at < len(items):
        length = _length(items[at])
        yield items[at : at + length]
        at += length


def _length(first: MissionItem) -> int:
    return int(first.p1) if first.command in POLYGONS else 1


def _group(item: MissionItem) -> float:
    return 0.0 if isnan(item.p2) else item.p2


def _place(item: MissionItem, origin: Geodetic) -> tuple[float, float]:
    east, north, _ = enu_of(Geodetic(item.x * DEGREES, item.y * DEGREES, 0.0), origin)
    return east, north
