"""Missions alone: plans, the fence that they must keep to, and what a mission does to home, mode and progress."""

import pytest

from colibri.autopilot.commander.rules.modes import FIRST, Mode, Need, State
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.guidance.mission.executor import ACTIVE, COMPLETE, NO_MISSION, NOT_STARTED, PAUSED
from colibri.mavlink.mission.items import FENCE, MISSION, RALLY, plan_of
from colibri.mavlink.services.command import FAILED
from colibri.mavlink.wire.dialect import Refusal
from tests.support.cockpit import FLYING, Cockpit, item

PLAN = (item("NAV_WAYPOINT", place=(5.0, 0.0, 10.0)), item("NAV_WAYPOINT", place=(5.0, 5.0, 10.0)))


def test_a_mission_is_flown_item_after_item_and_then_held() -> None:
    cockpit = Cockpit(FLYING)
    assert not cockpit.missions.total
    cockpit.load(MISSION, *PLAN)
    assert cockpit.said("mission of 2 items")
    assert (bool(cockpit.missions.total), cockpit.missions.executor.progress.state) == (True, NOT_STARTED)
    assert cockpit.pilot.select(Mode.MISSION, {}) is None
    cockpit.step()
    assert cockpit.missions.executor.progress.state == ACTIVE
    cockpit.fly_for(15.0)
    assert cockpit.missions.take_reached() == [0, 1]
    assert cockpit.missions.take_reached() == []
    assert cockpit.missions.executor.progress.state == COMPLETE
    assert cockpit.pilot.state == State(Mode.HOLD, armed=True)
    assert cockpit.said("Mission finished: hold")
    assert cockpit.state.position_enu_m == pytest.approx((5.0, 5.0, 10.0), abs=0.3)


def test_another_mode_pauses_it_and_it_goes_on_where_it_was() -> None:
    cockpit = Cockpit(FLYING)
    cockpit.load(MISSION, *PLAN)
    cockpit.pilot.select(Mode.MISSION, {})
    cockpit.fly_for(1.0)
    cockpit.pilot.select(Mode.HOLD, {})
    cockpit.step()
    assert cockpit.missions.executor.progress.state == PAUSED
    cockpit.pilot.select(Mode.MISSION, {})
    cockpit.fly_for(15.0)
    assert cockpit.missions.executor.progress.state == COMPLETE


def test_a_return_item_leaves_the_rest_to_mode_return() -> None:
    cockpit = Cockpit(FLYING)
    cockpit.load(MISSION, PLAN[0], item("NAV_RETURN_TO_LAUNCH"))
    cockpit.pilot.select(Mode.MISSION, {})
    cockpit.fly_for(8.0)
    assert cockpit.pilot.state == State(Mode.RETURN, armed=True)
    assert cockpit.said("Mission RTL item: return")
    assert cockpit.missions.take_reached() == [0, 1]
    assert cockpit.missions.executor.progress.state == COMPLETE
    cockpit.fly_for(60.0)
    assert cockpit.pilot.state == FIRST


def test_a_mission_moves_home() -> None:
    cockpit = Cockpit(FLYING)
    cockpit.load(MISSION, item("DO_SET_HOME", 1.0), PLAN[0])
    cockpit.pilot.select(Mode.MISSION, {})
    cockpit.step(2)
    assert cockpit.home.position_enu_m == pytest.approx(FLYING, abs=0.01)
    assert cockpit.home.chosen


def test_an_item_outside_the_fence_blocks_the_mission() -> None:
    cockpit = Cockpit(FLYING)
    cockpit.load(FENCE, item("NAV_FENCE_CIRCLE_INCLUSION", 8.0, place=(0.0, 0.0, 0.0)))
    cockpit.load(MISSION, PLAN[0], item("NAV_WAYPOINT", place=(9.0, 0.0, 10.0)))
    assert Need.INSIDE_FENCE in cockpit.missions.unmet
    assert cockpit.said("item 1 of the mission: outside the geofence")
    cockpit.missions.moved_origin()
    assert not cockpit.said("item 1")
    cockpit.load(FENCE)
    assert Need.INSIDE_FENCE not in cockpit.missions.unmet


def test_an_item_below_the_ground_blocks_the_mission() -> None:
    cockpit = Cockpit(FLYING)
    low, high = item("NAV_WAYPOINT", place=(9.0, 0.0, -4.0)), item("NAV_WAYPOINT", place=(9.0, 0.0, 0.0))
    cockpit.load(MISSION, PLAN[0], high, low)
    assert Need.ABOVE_GROUND in cockpit.missions.unmet
    assert cockpit.said("item 2 of the mission: 4.0 m below the ground")
    cockpit.load(MISSION, PLAN[0], high, item("NAV_LAND", place=(9.0, 0.0, -4.0)))
    assert Need.ABOVE_GROUND not in cockpit.missions.unmet
    cockpit.home.move((0.0, 0.0, -4.0), 0.0)
    cockpit.load(MISSION, high)
    assert Need.ABOVE_GROUND not in cockpit.missions.unmet, "as low as home"


@pytest.mark.parametrize("copter", [True, False])
def test_height_0_keeps_the_height_of_a_copter(copter: bool) -> None:
    cockpit = Cockpit(FLYING, behaviour=Behaviour(copter_items=copter))
    cockpit.load(MISSION, PLAN[0], item("NAV_WAYPOINT", place=(9.0, 0.0, 0.0)))
    assert cockpit.said("along the ground") is not copter


def test_the_home_fence_follows_home_and_parameters() -> None:
    cockpit = Cockpit()
    assert not cockpit.fence.exists
    cockpit.missions.adopt(Behaviour(max_distance_m=10.0, max_height_m=20.0))
    assert cockpit.fence.exists
    assert cockpit.fence.refusal((11.0, 0.0, 0.0)) == Refusal("more than 10 m from home")
    assert cockpit.fence.refusal((0.0, 0.0, 21.0)) == Refusal("more than 20 m above home")
    cockpit.home.move((5.0, 0.0, 0.0), 0.0)
    assert cockpit.fence.refusal((11.0, 0.0, 0.0)) is None
    assert cockpit.fence.margin_m((11.0, 0.0, 0.0)) == pytest.approx(4.0)


def test_a_breach_is_judged_ten_times_a_second() -> None:
    cockpit = Cockpit(behaviour=Behaviour(max_distance_m=10.0))
    assert cockpit.fence.breach((11.0, 0.0, 0.0), 0, 0.0) is not None
    assert cockpit.fence.breach((0.0, 0.0, 0.0), 99_000, 0.0) is not None
    assert cockpit.fence.breach((0.0, 0.0, 0.0), 100_000, 0.0) is None


def test_plans_that_were_kept_go_on_where_the_mission_stood() -> None:
    before = Cockpit(FLYING)
    before.load(MISSION, *PLAN)
    before.pilot.select(Mode.MISSION, {})
    before.fly_for(4.0)
    record = before.missions.executor.record()
    plans = {RALLY: plan_of(()), FENCE: plan_of(()), MISSION: plan_of(PLAN)}
    after = Cockpit(FLYING)
    after.missions.resume(plans, record)
    assert after.missions.executor.progress == before.missions.executor.progress
    after.missions.resume(plans, None)
    assert after.missions.executor.progress.seq == 0
    after.missions.resume({**plans, MISSION: plan_of(())}, record)
    assert after.missions.executor.progress.state == NO_MISSION


def test_plans_count_as_changes_and_the_current_item_must_exist() -> None:
    cockpit = Cockpit()
    for plan_type in (MISSION, FENCE, RALLY):
        cockpit.load(plan_type)
    assert cockpit.missions.changes == 3
    assert cockpit.missions.executor.set_current(0, False) == Refusal("item 0 refused: there is no mission", FAILED)
    cockpit.load(MISSION, *PLAN)
    assert cockpit.missions.executor.set_current(1, False) is None
    assert cockpit.missions.executor.progress.seq == 1
