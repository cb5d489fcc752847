"""Plans of a live vehicle as surroundings."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from colibri.common.types import Vector
from colibri.mavlink.mission.items import FENCE, MISSION, RALLY, MissionItem
from colibri.mavlink.services.command import GLOBAL_FRAMES
from colibri.mavlink.wire.dialect import mav
from colibri.view.geometry import circle
from colibri.view.snapshot import Mark, Surroundings, Zone

_POLYGONS = {
    mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: True,
    mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: False,
}
_CIRCLES = {
    mav.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: True,
    mav.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: False,
}

Place = Callable[[MissionItem], Vector]
"""(item) -> its place in the local frame, ENU; nan if unknown."""


def drawn(plans: Mapping[int, Sequence[MissionItem]], home_enu_m: Vector, place: Place) -> Surroundings:
    return Surroundings(
        ground_m=0.0 if home_enu_m[2] != home_enu_m[2] else home_enu_m[2],
        home_enu_m=home_enu_m,
        mission=_marks(plans.get(MISSION, ()), "", place),
        rally=_marks(plans.get(RALLY, ()), "rally ", place),
        fence=_zones(plans.get(FENCE, ()), place),
    )


def _marks(items: Sequence[MissionItem], word: str, place: Place) -> tuple[Mark, ...]:
    marks = []
    for seq, item in enumerate(items):
        if item.frame in GLOBAL_FRAMES and (item.x or item.y):
            there = place(item)
            if there[0] == there[0]:
                marks.append(Mark(there, f"{word}{seq + 1}"))
    return tuple(marks)


def _zones(items: Sequence[MissionItem], place: Place) -> tuple[Zone, ...]:
    zones: list[Zone] = []
    corners: list[tuple[float, float]] = []
    for item in items:
        if item.command not in _POLYGONS and item.command not in _CIRCLES:
            continue
        east, north, _ = place(item)
        if east != east:
            return ()
        if item.command in _CIRCLES:
            zones.append(Zone(circle(east, north, item.p1), _CIRCLES[item.command]))
            continue
        corners.append((east, north))
        if len(corners) == round(item.p1):
            zones.append(Zone(np.array(corners), _POLYGONS[item.command]))
            corners = []
    return tuple(zones)
