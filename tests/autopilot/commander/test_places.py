"""Places in commands and items: every MAV_CMD that takes one, with 0/0, NaN, far away, and in each frame."""

from collections.abc import Callable
from math import hypot, inf, isnan, nan

import pytest

from colibri.autopilot.commander.rules.modes import Mode, Need
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.guidance.mission.geofence import FENCE_RULES
from colibri.autopilot.guidance.mission.items import FLOWN, MISSION_RULES, RALLY_RULES, is_here, places
from colibri.autopilot.guidance.tasks.orbit import OrbitTask
from colibri.autopilot.guidance.tasks.position import GoToTask, TakeoffTask
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.mavlink.mission.items import ACCEPTED as ITEM_ACCEPTED
from colibri.mavlink.mission.items import FENCE, MISSION, RALLY, MissionItem
from colibri.mavlink.services.command import ACCEPTED, DENIED, GLOBAL_FRAMES, NOT_GIVEN
from colibri.mavlink.wire.dialect import mav
from tests.support.cockpit import FLYING, Cockpit, item

LATITUDE, LONGITUDE, ALTITUDE_M = DEFAULT_ORIGIN
SEA, HOME, TERRAIN = (0, 5), (3, 6), (10, 11)
NOWHERE = [
    (0.0, 0.0),
    (nan, LONGITUDE),
    (LATITUDE, nan),
    (91.0, 8.0),
    (47.0, 181.0),
    (inf, 8.0),
    (LATITUDE - 18.0, 8.0),
]
GOES = ("DO_REPOSITION", "DO_ORBIT", "DO_SET_HOME")
STAYS = ("NAV_LAND", "NAV_LOITER_UNLIM")


def flying() -> Cockpit:
    cockpit = Cockpit(FLYING)
    cockpit.step()
    cockpit.lines.take()
    return cockpit


def ask(cockpit: Cockpit, command: str, frame: int | None, x: float, y: float, z: float) -> tuple[int, str]:
    """Return result and every text of a command to a place."""
    params = (0.0,) if command == "DO_SET_HOME" else ()
    outcome = cockpit.do(command, *params, frame=frame, x=x, y=y, z=z)
    return outcome.result, " ".join([outcome.reason, *(text for _, text in cockpit.lines.take())])


def up_of(cockpit: Cockpit, command: str) -> float:
    """Return the height above home's first place that a command leads to."""
    task = cockpit.pilot.task
    if command == "DO_SET_HOME":
        return cockpit.home.position_enu_m[2]
    if isinstance(task, OrbitTask):
        return task.order.center_enu_m[2]
    assert isinstance(task, GoToTask | TakeoffTask)
    order = task.order
    return order.height_enu_m if isinstance(task, TakeoffTask) else order.position_enu_m[2]  # type: ignore[union-attr]


@pytest.mark.parametrize("command", GOES)
@pytest.mark.parametrize("frame", [*sorted(GLOBAL_FRAMES), None])
@pytest.mark.parametrize("place", NOWHERE)
def test_commands_to_nowhere_are_refused(command: str, frame: int | None, place: tuple[float, float]) -> None:
    cockpit = flying()
    task, home = cockpit.pilot.task, cockpit.home.position_enu_m
    result, said = ask(cockpit, command, frame, *place, ALTITUDE_M)
    assert result == DENIED
    assert any(word in said for word in ("latitude", "longitude", "km away"))
    assert (cockpit.pilot.task, cockpit.home.position_enu_m) == (task, home)


@pytest.mark.parametrize("command", STAYS)
def test_commands_that_stay_here_warn_of_a_place_elsewhere(command: str) -> None:
    far = (LATITUDE - 18.0, LONGITUDE)
    for place, warned in ((far, True), ((91.0, 8.0), True), ((0.0, 0.0), False), ((nan, nan), False)):
        result, said = ask(flying(), command, None, *place, nan)
        assert (result, "here, not at" in said) == (ACCEPTED, warned)


@pytest.mark.parametrize(
    ("command", "z", "ups"),
    [
        ("DO_REPOSITION", 12.0, {SEA: None, HOME: 12.0, TERRAIN: 12.0, (None, 2): None}),
        ("DO_ORBIT", 12.0, {SEA: None, HOME: None, TERRAIN: 12.0, (None, 2): None}),
        ("DO_SET_HOME", 12.0, {SEA: None, HOME: None, TERRAIN: 12.0, (None, 2): None}),
        ("NAV_TAKEOFF", 12.0, {SEA: None, HOME: 12.0, TERRAIN: 12.0, (None, 2): 12.0}),
    ],
)
def test_heights_of_commands_in_each_frame(
    command: str, z: float, ups: dict[tuple[int | None, ...], float | None]
) -> None:
    """None: above sea level."""
    for frames, up in ups.items():
        for frame in frames:
            cockpit = flying()
            sent = z + ALTITUDE_M if up is None else z
            assert ask(cockpit, command, frame, LATITUDE, LONGITUDE, sent)[0] == ACCEPTED
            assert up_of(cockpit, command) == pytest.approx(z, abs=0.01)


@pytest.mark.parametrize("command", GOES)
@pytest.mark.parametrize(("north_deg", "warned"), [(0.01, False), (0.2, True)])
def test_places_beyond_ten_kilometres_are_warned_of(command: str, north_deg: float, warned: bool) -> None:
    result, said = ask(flying(), command, 0, LATITUDE + north_deg, LONGITUDE, ALTITUDE_M + 10.0)
    assert (result, "22 km away" in said) == (ACCEPTED, warned)


def test_low_places_and_low_homes_are_warned_of() -> None:
    for command in ("DO_REPOSITION", "DO_ORBIT"):
        result, said = ask(flying(), command, 0, LATITUDE, LONGITUDE, ALTITUDE_M)
        assert (result, "along the ground" in said) == (ACCEPTED, True)
    for altitude_m, words in ((0.0, "488 m below the ground"), (2.0 * ALTITUDE_M, "488 m above the ground")):
        assert words in ask(flying(), "DO_SET_HOME", 0, LATITUDE, LONGITUDE, altitude_m)[1]


def made(command: int, frame: int, x: float, y: float, height_m: float = 5.0) -> MissionItem:
    """Return an item at degrees; all its parameters are 1."""
    x7, y7 = (NOT_GIVEN if isnan(degrees) else round(degrees * 1e7) for degrees in (x, y))
    p1 = 0.0 if command == mav.MAV_CMD_DO_SET_HOME else 3.0 if command in (5001, 5002) else 1.0
    return MissionItem(frame, command, 1, p1, 1.0, 1.0, 1.0, x7, y7, height_m)


PLACED = sorted(
    command
    for command in FLOWN
    if list(places([made(command, 3, LATITUDE, LONGITUDE)], (0.0, 0.0, 0.0), DEFAULT_ORIGIN))
)
"""Mission items that take a place."""
OTHERS = [(FENCE_RULES, 5001), (FENCE_RULES, 5002), (FENCE_RULES, 5003), (FENCE_RULES, 5004), (RALLY_RULES, 5100)]


def test_items_with_a_place_are_known() -> None:
    assert PLACED == [16, 17, 18, 19, 21, 22, 31, mav.MAV_CMD_DO_SET_HOME]


@pytest.mark.parametrize(("rules", "command"), [*((MISSION_RULES, command) for command in PLACED), *OTHERS])
@pytest.mark.parametrize("frame", sorted(GLOBAL_FRAMES))
def test_items_at_no_place_are_refused_or_are_here(rules: object, command: int, frame: int) -> None:
    check: Callable[[MissionItem], int] = rules.check_item  # type: ignore[attr-defined]
    assert check(made(command, frame, LATITUDE, LONGITUDE)) == ITEM_ACCEPTED
    for x, y in ((0.0, 0.0), (nan, nan)):
        nowhere = made(command, frame, x, y)
        allowed = command in (mav.MAV_CMD_NAV_TAKEOFF, mav.MAV_CMD_NAV_LAND) and is_here(nowhere)
        assert (check(nowhere) == ITEM_ACCEPTED) is allowed
    assert check(made(command, frame, 91.0, 8.0)) == mav.MAV_MISSION_INVALID_PARAM5_X
    assert check(made(command, frame, 47.0, 181.0)) == mav.MAV_MISSION_INVALID_PARAM6_Y


@pytest.mark.parametrize("command", PLACED)
@pytest.mark.parametrize(("south_deg", "word", "blocks"), [(0.2, "22 km away", False), (18.0, "2000 km away", True)])
def test_missions_far_away_are_named(command: int, south_deg: float, word: str, blocks: bool) -> None:
    cockpit = flying()
    cockpit.load(MISSION, item("NAV_TAKEOFF", place=(0.0, 0.0, 5.0)), made(command, 3, LATITUDE - south_deg, LONGITUDE))
    said = " ".join(text for _, text in cockpit.lines.take())
    assert f"item 1 of the mission: {word}" in said.replace("2001", "2000").replace("2002", "2000")
    assert (Need.WITHIN_REACH in cockpit.missions.unmet) is blocks


def test_a_moved_origin_or_home_is_told_of_with_the_mission() -> None:
    cockpit = flying()
    cockpit.load(MISSION, item("NAV_WAYPOINT", place=(5.0, 0.0, 10.0)))
    cockpit.lines.take()
    cockpit.missions.move_origin(DEFAULT_ORIGIN._replace(latitude_deg=LATITUDE - 0.5))
    said = [text for _, text in cockpit.lines.take()]
    assert said == [
        "origin moved by 55597 m: the plans stay where they are",
        "item 0 of the mission: 56 km away from home",
    ]
    there = cockpit.place(0.0, 40_000.0)
    assert cockpit.do("DO_SET_HOME", 0.0, x=there.latitude_deg, y=there.longitude_deg, z=ALTITUDE_M).result == ACCEPTED
    assert cockpit.said("home: 96 km away")


@pytest.mark.parametrize(
    ("first", "hinted"),
    [
        (made(16, 0, LATITUDE, LONGITUDE, ALTITUDE_M), True),
        (made(16, 0, LATITUDE, LONGITUDE, 0.0), True),
        (made(16, 3, LATITUDE, LONGITUDE, 0.0), True),
        (made(16, 3, LATITUDE, LONGITUDE, 10.0), False),
        (made(16, 3, LATITUDE + 0.001, LONGITUDE, 0.0), False),
        (made(22, 3, LATITUDE, LONGITUDE, 5.0), False),
    ],
)
def test_home_as_item_0_gets_a_hint(first: MissionItem, hinted: bool) -> None:
    cockpit = flying()
    cockpit.load(MISSION, first, item("NAV_WAYPOINT", place=(5.0, 0.0, 10.0)))
    assert cockpit.said("item 0 is home, as in ArduPilot: leave it out") is hinted


NEAR, OUT, FAR = (25.0, 0.0, 5.0), (25.0, 60.0, 5.0), (25.0, 2_000_000.0, 5.0)


@pytest.mark.parametrize(
    ("start", "rally", "lands"),
    [
        ((30.0, 0.0, 10.0), [NEAR], NEAR),
        ((30.0, 0.0, 10.0), [OUT, NEAR], NEAR),
        ((30.0, 0.0, 10.0), [OUT], (0.0, 0.0, 0.0)),
        ((30.0, 0.0, 10.0), [], (0.0, 0.0, 0.0)),
        ((10.0, 0.0, 10.0), [NEAR], (0.0, 0.0, 0.0)),
        ((30.0, 0.0, 10.0), [FAR], (0.0, 0.0, 0.0)),
    ],
)
@pytest.mark.parametrize("by", ["mode", "item"])
def test_a_return_lands_at_the_nearest_of_home_and_rally_points(
    start: tuple[float, float, float],
    rally: list[tuple[float, float, float]],
    lands: tuple[float, float, float],
    by: str,
) -> None:
    cockpit = Cockpit(start, behaviour=Behaviour(max_height_m=20.0, max_distance_m=50.0))
    cockpit.home.move((0.0, 0.0, 0.0), 0.0)
    cockpit.load(RALLY, *(item("NAV_RALLY_POINT", place=place) for place in rally))
    assert cockpit.said("not flown to") is (OUT in rally or FAR in rally)
    cockpit.load(MISSION, item("NAV_RETURN_TO_LAUNCH"))
    cockpit.pilot.select(Mode.RETURN if by == "mode" else Mode.MISSION, {})
    highest = 0.0
    for _ in range(60):
        cockpit.fly_for(1.0)
        highest = max(highest, cockpit.state.position_enu_m[2])
    assert not cockpit.pilot.state.armed
    x, y, _ = cockpit.state.position_enu_m
    assert hypot(x - lands[0], y - lands[1]) < 0.5
    assert highest < 20.0, "below the fence, though RTL_RETURN_ALT is 30 m"


@pytest.mark.parametrize("behaviour", [Behaviour(), Behaviour(return_delay_s=5.0, return_cone=3.0)])
def test_a_return_on_the_ground_stays_there(behaviour: Behaviour) -> None:
    cockpit = Cockpit((30.0, 0.0, 0.0), behaviour=behaviour)
    cockpit.home.move((0.0, 0.0, 0.0), 0.0)
    assert cockpit.do("COMPONENT_ARM_DISARM", 1.0).result == ACCEPTED
    assert cockpit.pilot.select(Mode.RETURN, {}) is None
    cockpit.fly_for(5.0)
    assert cockpit.state.position_enu_m == (30.0, 0.0, 0.0)


def test_a_fence_of_this_frame_prevents_arming() -> None:
    cockpit = Cockpit((20.0, 0.0, 0.0))
    cockpit.load(FENCE, item("NAV_FENCE_CIRCLE_INCLUSION", 8.0, place=(0.0, 0.0, 0.0)))
    outcome = cockpit.do("COMPONENT_ARM_DISARM", 1.0)
    assert (outcome.result, outcome.reason) == (DENIED, "Arming denied: outside the geofence")
