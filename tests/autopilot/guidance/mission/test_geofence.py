"""Geofences: https://mavlink.io/en/messages/common.html#MAV_CMD_NAV_FENCE_RETURN_POINT and the items after it."""

from collections.abc import Sequence
from math import atan2, cos, hypot, inf, nan, pi, sin
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from colibri.autopilot.guidance.mission.geofence import FENCE_RULES, Discs, Geofence, Polygons
from colibri.common.earth.geodesy import DEFAULT_ORIGIN, geodetic_of
from colibri.mavlink.mission.items import ACCEPTED, MissionItem
from colibri.mavlink.wire.dialect import Refusal, mav
from tests.support.strategies import reals

IN, OUT, DISC_IN, DISC_OUT, BACK = 5001, 5002, 5003, 5004, 5000
SQUARE = [(-10.0, -10.0), (10.0, -10.0), (10.0, 10.0), (-10.0, 10.0)]
DIAMOND = [(0.0, -1.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0)]
HOLE = [(-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0)]
HOUR_GLASS = [(0.0, 0.0), (4.0, 4.0), (4.0, 0.0), (0.0, 4.0)]
HORSESHOE = [(0.0, 0.0), (6.0, 0.0), (6.0, 6.0), (4.0, 6.0), (4.0, 2.0), (2.0, 2.0), (2.0, 6.0), (0.0, 6.0)]


def item(command: int, east: float, north: float, p1: float = nan, **changes: Any) -> MissionItem:
    place = geodetic_of((east, north, 0.0), DEFAULT_ORIGIN)
    x, y = round(place.latitude_deg * 1e7), round(place.longitude_deg * 1e7)
    return MissionItem(0, command, 1, p1, 0.0, 0.0, 0.0, x, y, 0.0)._replace(**changes)


def polygon(command: int, vertices: list[tuple[float, float]], **changes: Any) -> list[MissionItem]:
    return [item(command, east, north, float(len(vertices)), **changes) for east, north in vertices]


def fence(*items: MissionItem) -> Geofence:
    assert all(FENCE_RULES.check_item(each) == ACCEPTED for each in items)
    assert FENCE_RULES.check_plan(items) == (ACCEPTED, 0)
    return Geofence(items, DEFAULT_ORIGIN)


def depth_m(zones: Discs | Polygons, east: float, north: float) -> float:
    return float(zones.depths_m(np.array([[east, north]]))[0, 0])


def test_no_fence_holds_nothing_back() -> None:
    assert fence().margin_m((1e6, -1e6, 1e5)) == inf
    assert fence().refusal((0.0, 0.0, 0.0)) is None
    assert fence().refusal((nan, 0.0, 0.0)) is not None
    assert fence().refusal((0.0, 0.0, inf)) is not None


def test_margins() -> None:
    around = fence(*polygon(IN, SQUARE), *polygon(OUT, HOLE), item(DISC_OUT, 6.0, 6.0, 1.0))
    for place, margin in [
        ((-5.0, 0.0, 0.0), 3.0),
        ((-9.0, 0.0, 0.0), 1.0),
        ((0.0, 0.0, 0.0), -2.0),
        ((6.0, 6.5, 0.0), -0.5),
        ((13.0, 14.0, 0.0), -5.0),
        ((-6.0, 0.0, 1e4), 4.0),
    ]:
        assert around.margin_m(place) == pytest.approx(margin, abs=0.02)
        assert (around.refusal(place) is None) == (margin > 0.0)


def test_what_is_refused_is_told() -> None:
    around = fence(item(DISC_IN, 0.0, 0.0, 5.0))
    assert around.refusal((0.0, 0.0, 10.0)) is None
    assert around.refusal((0.0, 6.0, 10.0)) == Refusal("outside the geofence")
    assert around.refusal((nan, 0.0, 0.0)) is not None


def test_groups_of_inclusions() -> None:
    """Inside all zones of a group, of one group at least."""
    together = fence(item(DISC_IN, 0.0, 0.0, 5.0), item(DISC_IN, 6.0, 0.0, 5.0))
    assert together.refusal((3.0, 0.0, 0.0)) is None
    assert together.refusal((-1.0, 0.0, 0.0)) is not None
    either = fence(item(DISC_IN, 0.0, 0.0, 5.0, p2=1.0), item(DISC_IN, 20.0, 0.0, 5.0, p2=nan))
    assert either.refusal((-1.0, 0.0, 0.0)) is None
    assert either.refusal((21.0, 0.0, 0.0)) is None
    assert either.refusal((10.0, 0.0, 0.0)) is not None


def test_a_circle_of_no_radius_is_none() -> None:
    """MAVSDK cannot send a polygon alone: who wants no circle sends this one."""
    around = fence(*polygon(IN, SQUARE), item(DISC_IN, 1e4, 1e4, 0.0), item(DISC_OUT, 0.0, 0.0, 0.0))
    assert around.margin_m((-5.0, 0.0, 0.0)) == pytest.approx(5.0, abs=0.02)


def test_return_points_are_accepted_and_ignored() -> None:
    assert fence(item(BACK, 3.0, -4.0)).margin_m((1e6, -1e6, 1e5)) == inf


def test_level_with_a_corner() -> None:
    """A ray through a corner crosses once."""
    diamond, horseshoe, glass = (Polygons([each]) for each in (DIAMOND, HORSESHOE, HOUR_GLASS))
    assert depth_m(diamond, 0.0, 0.0) == pytest.approx(0.5**0.5)
    assert depth_m(diamond, -2.0, 0.0) == pytest.approx(-1.0)
    assert depth_m(diamond, -2.0, 1.0) == pytest.approx(-(2.0**0.5))
    assert depth_m(horseshoe, 3.0, 5.0) == pytest.approx(-1.0)
    assert depth_m(horseshoe, 1.0, 5.0) == pytest.approx(1.0)
    assert depth_m(glass, 2.0, 1.0) < 0.0 < depth_m(glass, 3.5, 2.0)


MILLIMETRES = st.integers(-100_000, 100_000).map(lambda number: number / 1000.0)


@given(st.lists(st.tuples(MILLIMETRES, MILLIMETRES), min_size=3, max_size=8), MILLIMETRES, MILLIMETRES)
def test_a_polygon_has_the_sum_of_angles_as_its_measure(
    vertices: list[tuple[float, float]], east: float, north: float
) -> None:
    depth = depth_m(Polygons([vertices]), east, north)
    assert depth_m(Polygons([vertices[::-1]]), east, north) == pytest.approx(depth, abs=1e-9)
    assume(abs(depth) > 1e-6)
    turned = 0.0
    for (a, b), (c, d) in zip(vertices, vertices[1:] + vertices[:1], strict=True):
        ax, ay, cx, cy = a - east, b - north, c - east, d - north
        turned += atan2(ax * cy - ay * cx, ax * cx + ay * cy)
    assert (round(turned / (2.0 * pi)) % 2 == 1) == (depth > 0.0)


@given(reals(100.0), reals(100.0), st.floats(0.0, 2.0 * pi), st.floats(0.1, 50.0))
def test_nothing_closer_than_the_margin_changes_sides(east: float, north: float, angle: float, part: float) -> None:
    for zone in (Polygons([HORSESHOE]), Discs([(1.0, 2.0)], [30.0])):
        depth = depth_m(zone, east, north)
        step = min(part, max(0.999 * abs(depth) - 1e-9, 0.0))
        there = depth_m(zone, east + step * cos(angle), north + step * sin(angle))
        assert there * depth >= 0.0 or abs(depth) < 1e-9
        assert abs(there - depth) <= step + 1e-9
    unit = Discs([(0.0, 0.0)], [1.0])
    assert depth_m(unit, east, north) == pytest.approx(1.0 - hypot(east, north), abs=1e-12)


def test_many_places_have_the_margins_of_each() -> None:
    zones = [*polygon(IN, SQUARE), item(DISC_OUT, 6.0, 6.0, 1.0), *polygon(OUT, HOLE), item(DISC_IN, 0.0, 0.0, 9.0)]
    around, places = fence(*zones), [(0.7 * i - 12.0, 0.5 * i - 9.0) for i in range(40)]
    margins = around.margins_m(np.array(places)).tolist()
    assert margins == [around.margin_m((*place, 0.0)) for place in places]
    alone = [fence(*zone).margin_m((*places[20], 0.0)) for zone in (zones[:4], zones[4:5], zones[5:9], zones[9:])]
    assert margins[20] == min(alone)


@pytest.mark.parametrize(
    ("changes", "result"),
    [
        ({"command": 16}, mav.MAV_MISSION_UNSUPPORTED),
        ({"frame": 2}, mav.MAV_MISSION_UNSUPPORTED_FRAME),
        ({"p1": 2.0}, mav.MAV_MISSION_INVALID_PARAM1),
        ({"p1": 3.5}, mav.MAV_MISSION_INVALID_PARAM1),
        ({"p1": nan}, mav.MAV_MISSION_INVALID_PARAM1),
        ({"p1": inf}, mav.MAV_MISSION_INVALID_PARAM1),
        ({"command": DISC_IN, "p1": -1.0}, mav.MAV_MISSION_INVALID_PARAM1),
        ({"command": DISC_OUT, "p1": nan}, mav.MAV_MISSION_INVALID_PARAM1),
        ({"p2": inf}, mav.MAV_MISSION_INVALID_PARAM2),
        ({"x": 900000001}, mav.MAV_MISSION_INVALID_PARAM5_X),
        ({"y": 1800000001}, mav.MAV_MISSION_INVALID_PARAM6_Y),
        ({"command": BACK, "p1": nan, "z": nan}, ACCEPTED),
    ],
)
def test_items_and_why_they_are_refused(changes: dict[str, Any], result: int) -> None:
    assert FENCE_RULES.check_item(item(IN, 0.0, 0.0, 3.0)._replace(**changes)) == result


def test_polygons_must_be_whole() -> None:
    square = polygon(IN, SQUARE)

    def check(items: Sequence[MissionItem]) -> int:
        return FENCE_RULES.check_plan(items)[0]

    assert check([*square, *polygon(OUT, HOLE), item(BACK, 0.0, 0.0)]) == ACCEPTED
    assert check(square[:3]) == mav.MAV_MISSION_INVALID_PARAM1
    assert check([*square[:3], item(DISC_IN, 0.0, 0.0, 4.0)]) == mav.MAV_MISSION_INVALID_PARAM1
    assert check([*square[:3], square[3]._replace(p1=3.0)]) == mav.MAV_MISSION_INVALID_PARAM1
    assert check([*square[:3], square[3]._replace(p2=1.0)]) == mav.MAV_MISSION_INVALID_PARAM2
