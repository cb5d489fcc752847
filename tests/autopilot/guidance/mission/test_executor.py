"""The mission executor: legs, jumps, pauses and progress, with a stand-in for the vehicle."""

from math import dist, hypot, inf, nan, pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.autopilot.guidance.mission.executor import (
    ACTIVE,
    COMPLETE,
    NO_MISSION,
    NOT_STARTED,
    PAUSED,
    MissionExecutor,
    Reached,
)
from colibri.autopilot.guidance.mission.items import COPTER_RULES, MISSION_RULES
from colibri.autopilot.guidance.mission.legs import Defaults, ItemContext, MissionContext, phases_of
from colibri.autopilot.guidance.tasks.orders import GoTo, Hold, Orbit, Return, TakeOff
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.mavlink.mission.items import ACCEPTED, MissionItem
from colibri.mavlink.services.command import FAILED
from colibri.mavlink.wire.dialect import Refusal, mav
from tests.support.mission_flight import HOME, ITEMS, STEP_US, Flight, begun, from_home, item

MINUTE_S = 60.0
AT_NOON = MissionContext(HOME, (0.0, 0.0, 0.0), 0.0, False, False, 0.0, HOME, DEFAULT_ORIGIN, 43_200_000_000)


def test_a_whole_mission_from_the_ground_and_back() -> None:
    flight = Flight(
        item("NAV_TAKEOFF", (0.0, 0.0, 10.0)),
        item("DO_CHANGE_SPEED", p1=1.0, p2=8.0),
        item("NAV_WAYPOINT", (30.0, 0.0, 10.0), p2=2.0, p4=90.0),
        item("IMAGE_START_CAPTURE", p1=1.0),
        item("NAV_WAYPOINT", (30.0, 20.0, 12.0), p1=1.0, p2=0.0),
        item("NAV_LAND", (0.0, 5.0, 0.0)),
        flying=False,
    )
    assert flight.mission.progress.state == NOT_STARTED
    assert flight.mission.start() is None
    flight.fly(MINUTE_S)
    assert flight.mission.progress == (5, COMPLETE, 2)
    assert flight.reached == [0, 1, 2, 3, 4, 5]
    assert flight.kinds() == ["TakeOff", "GoTo", "GoTo", "Land"]
    assert from_home(flight) == pytest.approx((0.0, 5.0, 0.0), abs=0.02)
    up, first, second, _ = flight.orders
    assert isinstance(up, TakeOff)
    assert up.height_enu_m == pytest.approx(10.5)
    assert isinstance(first, GoTo)
    assert first.speed_m_s == 8.0
    assert first.yaw_rad == pytest.approx(0.0)
    assert isinstance(second, GoTo)
    assert second.yaw_rad is None


def test_items_of_arducopter_at_0_0_are_where_it_is_going() -> None:
    flight = Flight(
        item("NAV_WAYPOINT", (30.0, 0.0, 10.0)),
        item("NAV_LOITER_TIME", p1=1.0)._replace(frame=3),
        item("NAV_SPLINE_WAYPOINT")._replace(frame=3, z=14.0),
        MissionItem(2, 218, 1, 70.0, 2.0, nan, nan, 0, 0, 0.0),
        rules=COPTER_RULES,
    )
    flight.mission.start()
    flight.fly(MINUTE_S)
    assert (flight.functions, flight.mission.progress.state) == ([(70, 2)], COMPLETE)
    assert from_home(flight) == pytest.approx((30.0, 0.0, 14.0), abs=0.6)


@pytest.mark.parametrize(
    ("numbers", "wait_s"),
    [((4.0, 0, 0, 0), 4.0), ((0, 12, 0, 10), 10.0), ((-1.0, 11, 59, 59), 86_399.0), ((0, -1, 1, 5), 65.0)],
)
def test_delays_of_arducopter_may_end_at_a_time(numbers: tuple[float, ...], wait_s: float) -> None:
    (leg,) = phases_of(item("NAV_DELAY", None, *numbers), ItemContext(AT_NOON, Defaults(), Hold(), None))
    assert not leg.ends(AT_NOON, wait_s - 0.01)
    assert leg.ends(AT_NOON, wait_s + 0.01)


def test_a_mission_that_begins_with_a_waypoint_takes_off_first() -> None:
    flight = begun(item("NAV_WAYPOINT", (9.0, 0.0, 6.0)), item("NAV_WAYPOINT", (9.0, 9.0, 1.0)), flying=False)
    flight.fly(MINUTE_S)
    assert flight.kinds() == ["TakeOff", "GoTo", "GoTo"]
    assert isinstance(flight.orders[0], TakeOff)
    assert flight.orders[0].height_enu_m == pytest.approx(HOME[2] + 6.0)
    assert flight.reached == [0, 1]
    low = begun(item("NAV_WAYPOINT", (9.0, 0.0, 1.0)), flying=False)
    low.step()
    assert isinstance(low.orders[0], TakeOff)
    assert low.orders[0].height_enu_m == pytest.approx(HOME[2] + 2.5)


def test_waypoints_without_hold_are_flown_through() -> None:
    through = begun(item("NAV_WAYPOINT", (20.0, 0.0, 5.0), p2=4.0), item("NAV_WAYPOINT", (20.0, 20.0, 5.0)))
    while not through.reached:
        through.step()
    assert dist(from_home(through), (20.0, 0.0, 5.0)) == pytest.approx(4.0, abs=0.2)
    assert len(through.orders) == 2
    assert min(through.speeds) > 4.0


@pytest.mark.parametrize(
    "waits",
    [
        item("NAV_WAYPOINT", (5.0, 0.0, 5.0), p1=3.0),
        item("NAV_LOITER_TIME", (5.0, 0.0, 5.0), p1=3.0),
        item("NAV_DELAY", p1=3.0),
        item("CONDITION_DELAY", p1=3.0),
    ],
)
def test_waiting(waits: MissionItem) -> None:
    flight = begun(item("NAV_WAYPOINT", (5.0, 0.0, 5.0)), waits, item("NAV_WAYPOINT", (5.0, 5.0, 5.0)))
    while 0 not in flight.reached:
        flight.step()
    began_us = flight.now_us
    while flight.mission.progress.seq < 2:
        flight.step()
    assert (flight.now_us - began_us) * 1e-6 == pytest.approx(3.0, abs=0.2)
    assert dist(from_home(flight), (5.0, 0.0, 5.0)) < 0.6


def test_loitering_for_ever() -> None:
    flight = begun(item("NAV_LOITER_UNLIM", (5.0, 0.0, 8.0), p4=180.0), item("NAV_LAND"))
    flight.fly(3600.0)
    assert (flight.mission.progress.seq, flight.mission.progress.state, flight.reached) == (0, ACTIVE, [0])
    assert flight.yaw == pytest.approx(-0.5 * pi)
    assert flight.mission.set_current(1) is None
    flight.fly(MINUTE_S)
    assert (flight.landed, flight.mission.progress.state) == (True, COMPLETE)


@pytest.mark.parametrize(("radius", "flown"), [(6.0, 6.0), (-6.0, -6.0), (nan, 10.0), (0.0, 10.0), (-0.25, -1.0)])
def test_circling(radius: float, flown: float) -> None:
    flight = begun(item("NAV_LOITER_TURNS", (20.0, 0.0, 8.0), p1=2.0, p3=radius), item("NAV_RETURN_TO_LAUNCH"))
    flight.step()
    (order,) = flight.orders
    assert isinstance(order, Orbit)
    assert order.radius_m == flown
    while not flight.reached:
        flight.step()
    assert 2.0 <= flight.turned[-1] < 2.2
    flight.fly(MINUTE_S)
    assert flight.landed
    assert hypot(*from_home(flight)) < 0.01


def test_a_stale_judgement_ends_nothing() -> None:
    """`arrived` and `turns` of the step in which an order is given are those of the order before."""
    flight = begun(
        item("NAV_LOITER_TURNS", (0.0, 0.0, 5.0), p1=1.0, p3=2.0),
        item("NAV_LOITER_TURNS", (50.0, 0.0, 5.0), p1=1.0, p3=2.0),
        item("NAV_WAYPOINT", (90.0, 0.0, 5.0)),
    )
    flight.arrived = True
    flight.turns = 7.0
    flight.fly(MINUTE_S)
    assert flight.kinds() == ["Orbit", "Orbit", "GoTo"]
    assert dist(from_home(flight), (90.0, 0.0, 5.0)) < 0.6


@pytest.mark.parametrize(
    ("p1", "p3", "p4", "yaw"),
    [(90.0, 0.0, 0.0, 0.0), (0.0, nan, nan, 0.5 * pi), (45.0, 1.0, 1.0, -0.25 * pi), (45.0, -1.0, 1.0, 0.25 * pi)],
)
def test_turning_on_the_spot(p1: float, p3: float, p4: float, yaw: float) -> None:
    flight = begun(item("CONDITION_YAW", p1=p1, p3=p3, p4=p4), item("NAV_WAYPOINT", (20.0, 0.0, 5.0)))
    while flight.mission.progress.seq == 0:
        flight.step()
    assert flight.yaw == pytest.approx(yaw)
    assert flight.reached == [0]
    assert dist(from_home(flight), (0.0, 0.0, 5.0)) < 0.2


def test_jumps_are_counted() -> None:
    flight = begun(
        item("NAV_WAYPOINT", (5.0, 0.0, 5.0)),
        item("NAV_WAYPOINT", (0.0, 0.0, 5.0)),
        item("DO_JUMP", p1=0.0, p2=2.0),
        item("NAV_LAND"),
    )
    flight.fly(MINUTE_S)
    assert flight.mission.progress.state == COMPLETE
    assert flight.reached == [0, 1, 2, 0, 1, 2, 0, 1, 2, 3]
    assert flight.mission.start() is None  # counts begin anew with the mission
    flight.reached.clear()
    flight.fly(MINUTE_S)
    assert flight.reached.count(1) == 3


def test_a_jump_to_a_tag_leads_to_its_first_item() -> None:
    tag, way = item("JUMP_TAG", p1=7.0), item("NAV_WAYPOINT", (5.0, 0.0, 5.0))
    flight = Flight(tag, way, tag, item("DO_JUMP_TAG", p1=7.0, p2=1.0), item("NAV_LAND"), rules=COPTER_RULES)
    flight.mission.start()
    flight.fly(MINUTE_S)
    assert flight.reached == [0, 1, 2, 3, 0, 1, 2, 3, 4]


def test_jumps_that_never_fly_do_not_hang_or_flood() -> None:
    """They hold, and the item that jumps is named once."""
    for items in (
        [item("DO_JUMP", p1=0.0, p2=-1.0)],
        [item("DO_CHANGE_SPEED", p2=3.0)] * 50 + [item("DO_JUMP", p1=0.0, p2=-1.0)],
        [item("NAV_DELAY", p1=0.0), item("DO_JUMP", p1=0.0, p2=60000.0)],
        [item("DO_JUMP", p1=1.0, p2=-1.0), item("DO_JUMP", p1=0.0, p2=-1.0)],
    ):
        flight = begun(*items)
        flight.fly(10.0)
        assert flight.mission.progress.state == ACTIVE
        assert 0 < len(flight.reached) < 15 * len(items)
        assert [items[seq].command for seq in flight.circling] == [mav.MAV_CMD_DO_JUMP]
        assert flight.mission.set_current(0) is None
        flight.mission.pause()
        assert flight.mission.progress.state == PAUSED


def test_pausing_goes_on_with_the_current_item() -> None:
    flight = begun(item("NAV_WAYPOINT", (9.0, 0.0, 5.0)), item("NAV_WAYPOINT", (9.0, 30.0, 5.0)))
    while flight.mission.progress.seq == 0:
        flight.step()
    assert flight.mission.pause() == ()
    assert flight.mission.progress == (1, PAUSED, 2)
    flight.step()
    assert flight.orders[-1] == Hold()
    flight.position = (-50.0, 0.0, 20.0)
    assert flight.mission.start() is None
    flight.fly(MINUTE_S)
    assert flight.reached == [0, 1]
    assert dist(from_home(flight), (9.0, 30.0, 5.0)) < 0.6


def test_an_item_that_another_mode_flies_to_its_end() -> None:
    flight = begun(item("NAV_WAYPOINT", (1.0, 0.0, 5.0)), item("NAV_RETURN_TO_LAUNCH"))
    while flight.orders[-1:] != [Return()]:
        flight.step()
    assert flight.mission.pause(item_flown=True) == (Reached(1),)
    assert flight.mission.progress == (1, COMPLETE, 2)
    early = begun(item("NAV_WAYPOINT", (50.0, 0.0, 5.0)), item("NAV_RETURN_TO_LAUNCH"))
    early.step()
    assert (
        early.mission.pause(item_flown=True) == ()
    )  # who chooses to return while a waypoint is flown has not flown it
    assert early.mission.progress == (0, PAUSED, 2)
    longer = begun(item("NAV_RETURN_TO_LAUNCH"), item("NAV_LAND"))
    longer.step()
    assert longer.mission.pause(item_flown=True) == (Reached(0),)
    assert longer.mission.progress == (1, PAUSED, 2)


def test_setting_the_current_item() -> None:
    flight = Flight(*[item("NAV_WAYPOINT", (5.0 * number, 0.0, 5.0)) for number in range(4)])
    assert flight.mission.set_current(4) == Refusal("mission: item 4 is not within 0 to 3", FAILED)
    assert flight.mission.set_current(-2) is not None
    assert flight.mission.set_current(2) is None
    assert flight.mission.progress == (2, NOT_STARTED, 2)
    flight.mission.start()
    flight.fly(MINUTE_S)
    assert flight.reached == [2, 3]
    assert flight.mission.set_current(1) is None
    assert flight.mission.progress == (1, COMPLETE, 2)
    flight.mission.start()
    flight.fly(MINUTE_S)
    assert flight.reached == [2, 3, 1, 2, 3]
    assert flight.mission.set_current(-1, reset=True) is None
    assert flight.mission.progress == (3, PAUSED, 2)


def test_a_mission_that_is_replaced_in_flight() -> None:
    flight = begun(item("NAV_WAYPOINT", (100.0, 0.0, 5.0)))
    flight.fly(1.0)
    flight.mission.load([item("NAV_WAYPOINT", (0.0, 10.0, 5.0)), item("NAV_WAYPOINT", (0.0, 20.0, 5.0))])
    assert flight.mission.progress == (0, ACTIVE, 1)
    flight.fly(MINUTE_S)
    assert dist(from_home(flight), (0.0, 20.0, 5.0)) < 0.6
    flight.mission.start()
    flight.mission.load([])
    assert flight.mission.progress.state == NO_MISSION
    flight.step()
    assert flight.orders[-1] == Hold()


def test_setting_home() -> None:
    flight = begun(item("DO_SET_HOME", p1=1.0), item("DO_SET_HOME", (4.0, 0.0, 0.0)), item("NAV_LAND"))
    flight.step()
    assert flight.homes == [None, pytest.approx((HOME[0] + 4.0, HOME[1], HOME[2]), abs=0.02)]


def test_speeds_last_until_they_are_changed() -> None:
    flight = begun(
        item("DO_CHANGE_SPEED", p1=1.0, p2=3.0),
        item("NAV_WAYPOINT", (10.0, 0.0, 5.0)),
        item("DO_CHANGE_SPEED", p1=2.0, p2=9.0),
        item("DO_CHANGE_SPEED", p2=-1.0),
        item("NAV_WAYPOINT", (20.0, 0.0, 5.0)),
        item("DO_CHANGE_SPEED", p2=-2.0),
        item("NAV_WAYPOINT", (30.0, 0.0, 5.0)),
    )
    flight.fly(MINUTE_S)
    assert [order.speed_m_s for order in flight.orders if isinstance(order, GoTo)] == [3.0, 3.0, None]


@given(
    st.lists(ITEMS.filter(lambda each: MISSION_RULES.check_item(each) == ACCEPTED), max_size=6),
    st.lists(st.tuples(st.integers(0, 5), st.integers(-2, 7), st.booleans(), st.booleans(), st.floats(0.0, 3.0))),
)
def test_whatever_is_uploaded_and_happens_can_be_flown(
    items: list[MissionItem], happens: list[tuple[int, int, bool, bool, float]]
) -> None:
    if MISSION_RULES.check_plan(items)[0] != ACCEPTED:
        return
    mission = MissionExecutor(items)
    now_us = 0
    for what, seq, landed, arrived, turns in happens:
        now_us += STEP_US
        if what == 0:
            mission.start()
        elif what == 1:
            mission.pause(item_flown=arrived)
        elif what == 2:
            mission.set_current(seq, reset=landed)
        mission_context = MissionContext(HOME, (0.0, 0.0, 0.0), 0.0, landed, arrived, turns, HOME, DEFAULT_ORIGIN)
        step = mission.step(mission_context, now_us)
        assert 0 <= mission.progress.seq < max(1, len(items))
        assert step.flying == mission.active
        if isinstance(step.order, GoTo):
            assert all(abs(part) < inf for part in step.order.position_enu_m)
        if not items:
            assert mission.progress.state == NO_MISSION
