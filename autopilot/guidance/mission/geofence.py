"""The geofence: polygons and circles, items MAV_CMD_NAV_FENCE_* of https://mavlink.io/en/messages/common.html.

The vehicle must be inside all inclusion zones of one group (parameter 2), and outside all exclusion zones. Circles of
radius 0 are placeholders.
"""

from collections.abc import Iterator, Sequence
from math import hypot, inf, isfinite, isnan
from typing import NamedTuple

import numpy as np

from colibri.autopilot.guidance.mission.items import check_place
from colibri.common.earth.compiled_geodesy import enu_of
from colibri.common.earth.geodesy import Geodetic
from colibri.common.types import Array, Vector
from colibri.mavlink.mission.items import ACCEPTED, MissionItem
from colibri.mavlink.mission.upload import Rules
from colibri.mavlink.services.command import DEGREES, GLOBAL_FRAMES
from colibri.mavlink.wire.dialect import Refusal, mav
from colibri.mavlink.wire.places import MAX_DISTANCE_M

RETURN_POINT: int = mav.MAV_CMD_NAV_FENCE_RETURN_POINT
POLYGONS: tuple[int, ...] = (
    mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
    mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
)
CIRCLES: tuple[int, ...] = (mav.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, mav.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION)
INCLUSIONS: tuple[int, ...] = (POLYGONS[0], CIRCLES[0])
FEWEST_VERTICES = 3
EDGE_M = 1e-6  # tolerance for points on an edge, which count as inside
OUTSIDE = Refusal("outside the geofence")


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
    return ACCEPTED if _is_ignored(item) else check_place(item)


def check_fence(items: Sequence[MissionItem]) -> tuple[int, int]:
    """Check that polygons are complete, of one kind and group."""
    seq = 0
    for vertices in _zones(items):
        first = vertices[0]
        if len(vertices) < _length(first) or any((v.command, v.p1) != (first.command, first.p1) for v in vertices[1:]):
            return int(mav.MAV_MISSION_INVALID_PARAM1), seq
        if first.command == POLYGONS[0] and any(_group(v) != _group(first) for v in vertices):
            return int(mav.MAV_MISSION_INVALID_PARAM2), seq
        seq += len(vertices)
    return ACCEPTED, 0


FENCE_RULES = Rules(check_fence_item, check_fence)


class Discs:
    def __init__(self, places_m: Sequence[tuple[float, float]], radii_m: Sequence[float]) -> None:
        self._east, self._north = np.array(places_m, dtype=float).reshape(-1, 2).T
        self._radii = np.array(radii_m, dtype=float)

    def depths_m(self, places_m: Array) -> Array:
        """Return the depth of each place (rows) inside each circle (columns), m; negative outside."""
        east, north = places_m[:, :1] - self._east, places_m[:, 1:] - self._north
        depths: Array = self._radii - np.sqrt(east * east + north * north)
        return depths


class Polygons:
    """The insides of polygons, by the even-odd rule."""

    def __init__(self, polygons_m: Sequence[Sequence[tuple[float, float]]]) -> None:
        starts = [np.array(vertices, dtype=float) for vertices in polygons_m]
        ends = [np.roll(vertices, -1, axis=0) for vertices in starts]
        self._firsts = np.cumsum([0, *map(len, starts)])[:-1]  # the first edge of each polygon
        self._east, self._north = np.concatenate([*starts, np.empty((0, 2))]).T
        to_east, self._to_north = np.concatenate([*ends, np.empty((0, 2))]).T
        self._along_east, self._along_north = to_east - self._east, self._to_north - self._north
        squared = self._along_east * self._along_east + self._along_north * self._along_north
        self._squared = np.where(squared > 0.0, squared, 1.0)

    def __len__(self) -> int:
        return len(self._east)

    def depths_m(self, places_m: Array) -> Array:
        """Return the depth of each place (rows) inside each polygon (columns), m; negative outside."""
        along_east, along_north = self._along_east, self._along_north
        to_east, to_north = places_m[:, :1] - self._east, places_m[:, 1:] - self._north  # from each edge's start
        part = (to_east * along_east + to_north * along_north) / self._squared
        part = np.minimum(np.maximum(part, 0.0), 1.0)
        away_east, away_north = to_east - part * along_east, to_north - part * along_north
        nearest = np.sqrt(np.minimum.reduceat(away_east**2 + away_north**2, self._firsts, axis=1))
        # An edge is crossed where just one of its ends is north of the point. Both edges of a corner compare the same
        # two numbers, so that a ray through it crosses once or not at all, however they round.
        starts, ends = self._north > places_m[:, 1:], self._to_north > places_m[:, 1:]
        crossed = (starts != ends) & ((along_east * to_north > along_north * to_east) == (along_north > 0.0))
        inside = np.logical_xor.reduceat(crossed, self._firsts, axis=1)
        return np.where(inside, nearest, -nearest)


class Geofence:
    """A fence in ENU, m; return points are accepted, and ignored."""

    def __init__(self, items: Sequence[MissionItem], origin: Geodetic) -> None:
        zones = sorted((zone for zone in _zones(items) if not _is_ignored(zone[0])), key=_rank)
        polygons = [i for i, zone in enumerate(zones) if zone[0].command in POLYGONS]
        discs = [i for i, zone in enumerate(zones) if zone[0].command in CIRCLES]
        self._polygons = Polygons([[_place(item, origin) for item in zones[i]] for i in polygons])
        self._discs = Discs([_place(zones[i][0], origin) for i in discs], [zones[i][0].p1 for i in discs])
        self._order = np.argsort([*polygons, *discs]) if polygons and discs else None
        ranks = [_rank(zone) for zone in zones if zone[0].command in INCLUSIONS]
        self._groups = [i for i, rank in enumerate(ranks) if i == 0 or rank != ranks[i - 1]]
        self._inclusions = len(ranks)
        self.size = len(self._polygons) + len(discs)

    def margins_m(self, places_m: Array) -> Array:
        """Return the depth inside of each place (east, north), m; negative outside."""
        if not self.size:
            return np.full(len(places_m), inf)
        depths = self._polygons.depths_m(places_m) if len(self._polygons) else self._discs.depths_m(places_m)
        if self._order is not None:
            depths = np.concatenate((depths, self._discs.depths_m(places_m)), axis=1)[:, self._order]
        margins: Array = -depths[:, self._inclusions :].max(axis=1, initial=-inf)
        if self._groups:
            inside = np.minimum.reduceat(depths[:, : self._inclusions], self._groups, axis=1)
            margins = np.minimum(margins, inside.max(axis=1))
        return margins

    def margin_m(self, position_enu_m: Vector) -> float:
        if not all(map(isfinite, position_enu_m)):
            return -inf
        return float(self.margins_m(np.array([position_enu_m[:2]]))[0])

    def refusal(self, position_enu_m: Vector) -> Refusal | None:
        return None if self.margin_m(position_enu_m) >= -EDGE_M else OUTSIDE


class AroundHome(NamedTuple):
    """The parameters' fence around home; 0 for off."""

    home_enu_m: Vector
    max_distance_m: float
    max_height_m: float
    floor_m: float = -inf

    def margin_m(self, position_enu_m: Vector) -> float:
        east, north, up = (place - home for place, home in zip(position_enu_m, self.home_enu_m, strict=True))
        if not (isfinite(east) and isfinite(north) and isfinite(up)):
            return -inf
        away_m = self.max_distance_m - hypot(east, north) if self.max_distance_m > 0.0 else inf
        away_m = min(away_m, self.max_height_m - up) if self.max_height_m > 0.0 else away_m
        return min(away_m, up - self.floor_m) if self.floor_m > -inf else away_m

    def refusal(self, position_enu_m: Vector) -> Refusal | None:
        if self.margin_m(position_enu_m) >= -EDGE_M:
            return None
        if position_enu_m[2] - self.home_enu_m[2] < self.floor_m:
            return Refusal(f"less than {self.floor_m:g} m above home")
        if 0.0 < self.max_height_m < position_enu_m[2] - self.home_enu_m[2]:
            return Refusal(f"more than {self.max_height_m:g} m above home")
        return Refusal(f"more than {self.max_distance_m:g} m from home")


def _zones(items: Sequence[MissionItem]) -> Iterator[Sequence[MissionItem]]:
    at = 0
    while at < len(items):
        length = _length(items[at])
        yield items[at : at + length]
        at += length


def _rank(zone: Sequence[MissionItem]) -> float:
    return _group(zone[0]) if zone[0].command in INCLUSIONS else inf


def _is_ignored(first: MissionItem) -> bool:
    return first.command == RETURN_POINT or (first.command in CIRCLES and first.p1 == 0.0)


def _length(first: MissionItem) -> int:
    return int(first.p1) if first.command in POLYGONS else 1


def _group(item: MissionItem) -> float:
    return 0.0 if isnan(item.p2) else item.p2


def _place(item: MissionItem, origin: Geodetic) -> tuple[float, float]:
    east, north, _ = enu_of(Geodetic(item.x * DEGREES, item.y * DEGREES, 0.0), origin)
    return east, north
