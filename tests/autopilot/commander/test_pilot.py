"""The pilot alone: every change of mode, every failsafe, arming, take-off and landing, on a vehicle that obeys."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.autopilot.commander.pilot import Sensed
from colibri.autopilot.commander.rules.failsafe_table import Action
from colibri.autopilot.commander.rules.modes import FIRST, ROWS, Mode, Need, State
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.guidance.guidance import RESTS
from colibri.autopilot.guidance.tasks.position import HoldTask
from colibri.autopilot.guidance.tasks.task import ClientInputs
from colibri.mavlink.mission.items import MISSION
from colibri.mavlink.setpoints.setpoints import Sticks
from tests.support.cockpit import FLYING, PREVIEW, Cockpit, at, item

STICKS = ClientInputs(sticks=Sticks(0.0, 0.0, 0.5, 0.0))
LEADS = {
    Action.HOLD: Mode.HOLD,
    Action.RETURN: Mode.RETURN,
    Action.LAND: Mode.LAND,
    Action.DESCEND: Mode.LAND,
    Action.TERMINATE: Mode.HOLD,
}


def in_the_air() -> Cockpit:
    cockpit = Cockpit(FLYING)
    cockpit.load(MISSION, item("NAV_WAYPOINT", place=(20.0, 0.0, 10.0)))
    cockpit.steered = STICKS
    cockpit.step()
    return cockpit


@pytest.fixture(scope="module")
def flying() -> Cockpit:
    return in_the_air()


@pytest.mark.parametrize(("mode", "need"), [(mode, need) for mode in Mode for need in ROWS[mode].needs])
def test_a_refused_mode_leaves_the_flight_as_it_is(flying: Cockpit, mode: Mode, need: Need) -> None:
    flying.pilot.select(Mode.LAND, {})
    task = flying.pilot.task
    refusal = flying.pilot.select(mode, {need: need.value})
    assert refusal is not None
    assert refusal.reason == f"{mode} refused: {need.value}"
    assert flying.pilot.state == State(Mode.LAND, armed=True)
    assert flying.pilot.task is task


@pytest.mark.parametrize("mode", Mode)
@pytest.mark.parametrize("action", LEADS)
def test_a_failsafe_action_sets_its_mode_from_any_mode(action: Action, mode: Mode) -> None:
    cockpit = in_the_air()
    cockpit.pilot.select(mode, {})
    cockpit.pilot.save(action)
    if action is Action.TERMINATE:
        assert cockpit.pilot.state == FIRST
        assert cockpit.pilot.terminated
        return
    assert cockpit.pilot.state == State(LEADS[action], armed=True)
    assert cockpit.pilot.saving is action
    assert cockpit.pilot.context().blind is (action is Action.DESCEND)
    assert cockpit.pilot.select(Mode.HOLD, {}) is None
    assert cockpit.pilot.saving is Action.NONE


@pytest.mark.parametrize(("mode", "need"), [(mode, need) for mode in Mode for need in ROWS[mode].needs])
def test_a_missing_need_other_than_position_prevents_arming(mode: Mode, need: Need) -> None:
    cockpit = Cockpit()
    cockpit.load(MISSION, item("NAV_WAYPOINT", place=(20.0, 0.0, 10.0)))
    cockpit.pilot.select(mode, {})
    armed = cockpit.pilot.arm({need: need.value}) is None
    assert armed is (ROWS[mode].to_arm and need is Need.POSITION)


@pytest.mark.parametrize("mode", Mode)
def test_a_flying_vehicle_is_disarmed_by_force_alone(mode: Mode) -> None:
    cockpit = in_the_air()
    cockpit.pilot.select(mode, {})
    refusal = cockpit.pilot.disarm()
    assert refusal is not None
    assert refusal.reason == "Disarming denied: not landed"
    assert cockpit.pilot.disarm(force=True) is None
    assert not cockpit.pilot.state.armed
    assert ROWS[cockpit.pilot.state.mode].to_arm


def test_a_takeoff_climbs_and_holds() -> None:
    cockpit = Cockpit()
    assert cockpit.pilot.select(Mode.TAKEOFF, {}) is None
    assert cockpit.pilot.arm({}) is None
    cockpit.step()
    assert cockpit.guidance.begins
    assert not cockpit.pilot.ground.standing
    cockpit.fly_for(6.0)
    assert cockpit.pilot.state == State(Mode.HOLD, armed=True)
    assert cockpit.state.position_enu_m[2] == pytest.approx(2.5, abs=0.1)
    assert isinstance(cockpit.pilot.task, HoldTask) is False, "the climb holds its end"
    assert cockpit.said("Takeoff altitude reached: hold")


def test_a_landing_is_noticed_and_stops_the_rotors() -> None:
    cockpit = Cockpit((0.0, 0.0, 3.0))
    assert cockpit.pilot.select(Mode.LAND, {}) is None
    cockpit.fly_for(11.0)
    assert cockpit.pilot.ground.standing
    assert cockpit.pilot.state == FIRST
    assert cockpit.guidance is RESTS
    assert [text for _, text in cockpit.lines.take()][-2:] == ["Landing detected", "Disarmed by landing"]


@pytest.mark.parametrize("mode", [Mode.HOLD, Mode.LAND, Mode.POSITION])
def test_an_impact_with_a_failed_sensor_stops_the_rotors(mode: Mode) -> None:
    cockpit = in_the_air()
    assert cockpit.pilot.select(mode, {}) is None
    drifting = at((0.0, 0.0, 10.5), (4.0, 0.0, 0.0))  # by its estimate, which would have it take off again
    for _ in range(30):
        cockpit.now_us += PREVIEW.interval_us
        cockpit.pilot.sense(Sensed(cockpit.now_us, drifting, STICKS, lift=0.1))
        cockpit.pilot.step()
    assert cockpit.pilot.state == FIRST
    assert [text for _, text in cockpit.lines.take()][-2:] == ["Impact at 4.0 m/s", "Disarmed by impact"]


def test_rotors_that_are_armed_and_do_not_lift_stop() -> None:
    cockpit = Cockpit(behaviour=Behaviour(disarm_on_ground_s=1.0))
    assert cockpit.pilot.arm({}) is None
    cockpit.fly_for(0.9)
    assert cockpit.pilot.state.armed
    cockpit.fly_for(0.2)
    assert cockpit.pilot.state == FIRST
    assert cockpit.said("Disarmed by auto preflight disarming")


def test_home_is_set_at_arming_unless_it_was_chosen() -> None:
    cockpit = Cockpit()
    cockpit.state = at((3.0, 4.0, 0.0), yaw_rad=1.0)
    cockpit.step()
    cockpit.pilot.arm({})
    assert (cockpit.home.position_enu_m, cockpit.home.yaw_rad) == ((3.0, 4.0, 0.0), 1.0)
    cockpit.pilot.disarm()
    cockpit.home.move((1.0, 1.0, 0.0), 0.5)
    cockpit.pilot.arm({})
    assert (cockpit.home.position_enu_m, cockpit.home.yaw_rad) == ((1.0, 1.0, 0.0), 0.5)


@pytest.mark.parametrize("mode", Mode)
def test_a_failed_rotor_prevents_mode_changes_and_arming(mode: Mode) -> None:
    cockpit = in_the_air()
    cockpit.pilot.readiness.lose_rotor(2)
    refusal = cockpit.pilot.select(mode, {}) if mode is not Mode.HOLD else cockpit.pilot.fly(mode, HoldTask(), {})
    assert refusal is not None
    assert refusal.reason == f"{mode} refused: rotor 3 failed"
    cockpit.pilot.disarm(force=True)
    assert cockpit.pilot.arm({}, force=True) is not None
    cockpit.pilot.adopt(replace(cockpit.pilot.behaviour, rotor_failure=0))
    assert cockpit.pilot.readiness.rotor_failed == ""


def test_a_requested_speed_is_limited_and_ends_with_the_flight() -> None:
    cockpit = in_the_air()
    cockpit.pilot.speed_m_s = 3.0
    assert cockpit.pilot.context().behaviour.limits.speed_m_s == 3.0
    cockpit.pilot.speed_m_s = 99.0
    assert cockpit.pilot.context().behaviour.limits.speed_m_s == cockpit.pilot.behaviour.max_speed_m_s
    cockpit.pilot.disarm(force=True)
    assert cockpit.pilot.speed_m_s is None


def test_after_a_restart_a_vehicle_that_has_come_down_stays_down() -> None:
    before = in_the_air()
    after = Cockpit()
    after.pilot.resume(10_000_000, at((0.0, 0.0, 0.0)), before.pilot.record(), after.tasks.begin, seamless=False)
    assert after.pilot.state == FIRST
    assert after.pilot.ground.standing


ORDERS = st.one_of(
    st.sampled_from(Mode),
    st.sampled_from([action for action in Action if action in LEADS]),
    st.sampled_from(["arm", "disarm", "force", "step", "second", "lose", "touch"]),
)


@given(st.lists(ORDERS, max_size=12), st.booleans())
def test_whatever_comes_the_pilot_stays_of_one_mind(orders: list[Mode | Action | str], flies: bool) -> None:
    cockpit = in_the_air() if flies else Cockpit()
    for order in orders:
        was_armed = cockpit.pilot.state.armed
        obey(cockpit, order)
        pilot = cockpit.pilot
        assert pilot.state.armed <= (was_armed or order == "arm")
        assert pilot.saving is Action.NONE or pilot.state.armed
        assert (cockpit.step() is RESTS) or pilot.state.armed
        assert pilot.ground.idles or pilot.state.armed


def obey(cockpit: Cockpit, order: Mode | Action | str) -> None:
    pilot = cockpit.pilot
    if isinstance(order, Mode):
        pilot.select(order, cockpit.missing())
    elif isinstance(order, Action):
        pilot.save(order)
    elif order == "arm":
        pilot.arm(cockpit.missing())
    elif order == "lose":
        pilot.readiness.lose_rotor(0)
    elif order == "touch" and pilot.state.armed:
        pilot.touch_down()
    elif order in ("disarm", "force"):
        pilot.disarm(force=order == "force")
    elif order == "second":
        cockpit.fly_for(1.0)
