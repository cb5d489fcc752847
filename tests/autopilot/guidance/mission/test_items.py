"""Which items a mission may hold: https://mavlink.io/en/messages/common.html#mav_commands."""

from math import inf, nan
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.autopilot.guidance.mission.geofence import FENCE_RULES
from colibri.autopilot.guidance.mission.items import MISSION_RULES, RALLY_RULES, places
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.mavlink.mission.items import ACCEPTED, MissionItem, fault_of
from colibri.mavlink.services.command import NOT_GIVEN
from colibri.mavlink.wire.dialect import mav
from tests.support.mission_flight import ITEMS

P1, P2, P3, P4 = (getattr(mav, f"MAV_MISSION_INVALID_PARAM{number}") for number in (1, 2, 3, 4))
P5, P6, P7 = mav.MAV_MISSION_INVALID_PARAM5_X, mav.MAV_MISSION_INVALID_PARAM6_Y, mav.MAV_MISSION_INVALID_PARAM7
BAD_FRAME = mav.MAV_MISSION_UNSUPPORTED_FRAME


def item(command: str, **changes: Any) -> MissionItem:
    wanted = MissionItem(3, getattr(mav, f"MAV_CMD_{command}"), 1, nan, nan, nan, nan, 473977420, 85455940, 5.0)
    return wanted._replace(**changes)


@pytest.mark.parametrize(
    "valid",
    [
        item("NAV_WAYPOINT"),  # MAVSDK leaves what it does not use nan
        item("NAV_WAYPOINT", frame=6, p1=0.5, p2=1.0, p3=0.0, p4=90.0),
        item("NAV_WAYPOINT", frame=0, z=500.0),
        item("NAV_LOITER_UNLIM", p4=-45.0),
        item("NAV_LOITER_TURNS", p1=2.0, p3=-20.0),
        item("NAV_LOITER_TO_ALT", p1=1.0, p2=5.0),
        item("NAV_TAKEOFF", x=0, y=0),
        item("NAV_TAKEOFF", x=NOT_GIVEN, y=NOT_GIVEN),
        item("NAV_LAND", z=nan),
        item("NAV_LAND", frame=2, x=0, y=0),
        item("NAV_RETURN_TO_LAUNCH", frame=2, x=0, y=0, z=nan),
        item("NAV_DELAY", frame=2, p1=3.0, p2=-1.0, p3=-1.0, p4=-1.0),
        item("CONDITION_DELAY", p1=3.0),
        item("CONDITION_YAW", frame=2, p1=180.0, p2=10.0, p3=-1.0, p4=1.0),
        item("DO_CHANGE_SPEED", frame=2, p1=1.0, p2=4.0, p3=-1.0, p4=0.0),
        item("DO_CHANGE_SPEED", frame=2, p1=1.0, p2=-2.0),
        item("DO_JUMP", frame=2, p1=0.0, p2=-1.0),
        item("DO_SET_HOME", frame=2, p1=1.0),
        item("DO_GIMBAL_MANAGER_PITCHYAW", frame=2, p1=inf, x=-1, y=99, z=inf),
        item("IMAGE_START_CAPTURE", frame=250),
        item("NAV_ROI"),
    ],
)
def test_items_that_are_flown_or_skipped(valid: MissionItem) -> None:
    assert MISSION_RULES.check_item(valid) == ACCEPTED


@pytest.mark.parametrize(
    ("refused", "result"),
    [
        (item("NAV_WAYPOINT", p1=-1.0), P1),
        (item("NAV_WAYPOINT", p2=-0.5), P2),
        (item("NAV_WAYPOINT", p4=inf), P4),
        (item("NAV_WAYPOINT", x=900000001), P5),
        (item("NAV_WAYPOINT", x=NOT_GIVEN), P5),
        (item("NAV_WAYPOINT", y=-1800000001), P6),
        (item("NAV_WAYPOINT", z=nan), P7),
        (item("NAV_WAYPOINT", z=1e5), P7),
        (item("NAV_WAYPOINT", frame=2), BAD_FRAME),
        (item("NAV_RETURN_TO_LAUNCH", frame=8), BAD_FRAME),
        (item("NAV_LOITER_TURNS", p3=inf), P3),
        (item("NAV_LOITER_TIME", p1=-2.0), P1),
        (item("NAV_TAKEOFF", x=0, y=0, z=nan), P7),
        (item("NAV_LAND", frame=2), BAD_FRAME),
        (item("NAV_TAKEOFF", frame=2, x=0, y=0), BAD_FRAME),
        (item("NAV_DELAY", frame=2, p1=-1.0), P1),  # by the clock of the day: there is none
        (item("CONDITION_YAW", frame=2), P1),
        (item("CONDITION_YAW", frame=2, p1=1.0, p3=2.0), P3),
        (item("DO_CHANGE_SPEED", frame=2, p1=7.0), P1),
        (item("DO_CHANGE_SPEED", frame=2, p1=1.0, p2=0.0), P2),
        (item("DO_JUMP", frame=2, p2=1.0), P1),
        (item("DO_JUMP", frame=2, p1=0.5, p2=1.0), P1),
        (item("DO_JUMP", frame=2, p1=0.0), P2),
        (item("DO_SET_HOME", frame=2, p1=0.0), BAD_FRAME),
        (item("DO_PARACHUTE", frame=2), mav.MAV_MISSION_UNSUPPORTED),
        (item("NAV_FENCE_CIRCLE_INCLUSION"), mav.MAV_MISSION_UNSUPPORTED),
        (item("NAV_WAYPOINT")._replace(command=65535), mav.MAV_MISSION_UNSUPPORTED),
    ],
)
def test_items_that_are_refused_and_why(refused: MissionItem, result: int) -> None:
    assert MISSION_RULES.check_item(refused) == result
    words = fault_of(refused, result)
    assert f"({refused.command})" in words or f"command {refused.command}" in words
    values = {P1 + index: f"parameter {index + 1} is {refused[3 + index]:g}" for index in range(4)}
    places = {P5: "latitude", P6: "longitude", P7: "altitude", BAD_FRAME: f"frame {refused.frame}"}
    assert {**values, **places, mav.MAV_MISSION_UNSUPPORTED: "is not supported"}[result] in words


def test_a_jump_out_of_the_mission_is_refused() -> None:
    jumps = [item("NAV_WAYPOINT"), item("DO_JUMP", frame=2, p1=1.0, p2=1.0)]
    assert MISSION_RULES.check_plan(jumps) == (ACCEPTED, 0)
    assert MISSION_RULES.check_plan([jumps[0], jumps[1]._replace(p1=2.0)]) == (P1, 1)


def test_rally_points() -> None:
    assert RALLY_RULES.check_item(item("NAV_RALLY_POINT")) == ACCEPTED
    assert RALLY_RULES.check_item(item("NAV_RALLY_POINT", x=900000001)) == P5
    assert RALLY_RULES.check_item(item("NAV_RALLY_POINT", y=NOT_GIVEN)) == P6
    assert RALLY_RULES.check_item(item("NAV_RALLY_POINT", z=nan)) == P7
    assert RALLY_RULES.check_item(item("NAV_RALLY_POINT", frame=2)) == BAD_FRAME
    assert RALLY_RULES.check_item(item("NAV_WAYPOINT")) == mav.MAV_MISSION_UNSUPPORTED


def test_where_items_are() -> None:
    home = (3.0, 4.0, 1.0)
    items = [
        item("DO_JUMP", p1=0.0, p2=1.0),
        item("NAV_WAYPOINT"),
        item("NAV_WAYPOINT", frame=5, z=500.0),
        item("NAV_TAKEOFF", x=0, y=0, z=7.0),
        item("NAV_LAND", x=0, y=0),
    ]
    expected = [(1, (0.0, 0.0, 6.0)), (2, (0.0, 0.0, 12.0)), (3, (3.0, 4.0, 8.0))]
    for (seq, place), (expected_seq, expected_place) in zip(places(items, home, DEFAULT_ORIGIN), expected, strict=True):
        assert seq == expected_seq
        assert place == pytest.approx(expected_place, abs=0.05)


@given(st.lists(ITEMS, max_size=5))
def test_whatever_an_item_says_it_gets_an_answer(items: list[MissionItem]) -> None:
    for rules in (MISSION_RULES, FENCE_RULES, RALLY_RULES):
        valid = [each for each in items if rules.check_item(each) == ACCEPTED]
        assert 0 <= rules.check_plan(valid)[0] < mav.MAV_MISSION_RESULT_ENUM_END
