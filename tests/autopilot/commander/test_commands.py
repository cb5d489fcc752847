"""Commands alone: what each does with good numbers, and that bad ones are denied and change nothing."""

from math import degrees, inf, nan, radians, remainder, tau

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from colibri.autopilot.commander.rules.modes import FIRST, ROWS, Mode, State, custom_mode
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.guidance.tasks.position import GoToTask, HoldTask, TakeoffTask
from colibri.common.earth.geodesy import Geodetic
from colibri.mavlink.mission.items import FENCE, MISSION
from colibri.mavlink.services.command import (
    ACCEPTED,
    DENIED,
    FAILED,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    ReceivedCommand,
)
from colibri.mavlink.wire.dialect import Refusal, mav
from tests.support.cockpit import FLYING, GROUND, Cockpit, item

FORCE = 21196.0
CUSTOM = float(mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)


@pytest.fixture
def flying() -> Cockpit:
    cockpit = Cockpit(FLYING)
    cockpit.load(MISSION, item("NAV_WAYPOINT", place=(20.0, 0.0, 10.0)))
    cockpit.step()
    return cockpit


@pytest.fixture
def standing() -> Cockpit:
    return Cockpit()


@pytest.mark.parametrize(
    ("command", "params", "mode"),
    [
        ("NAV_LAND", (), Mode.LAND),
        ("NAV_RETURN_TO_LAUNCH", (), Mode.RETURN),
        ("NAV_LOITER_UNLIM", (), Mode.HOLD),
        ("MISSION_START", (), Mode.MISSION),
        ("DO_PAUSE_CONTINUE", (0.0,), Mode.HOLD),
        ("DO_PAUSE_CONTINUE", (1.0,), Mode.MISSION),
        ("DO_REPOSITION", (-1.0, 1.0), Mode.HOLD),
        ("CONDITION_YAW", (90.0, 0.0, 1.0, 0.0), Mode.HOLD),
        ("DO_ORBIT", (5.0, 2.0), Mode.ORBIT),
    ],
)
def test_a_command_changes_the_mode(flying: Cockpit, command: str, params: tuple[float, ...], mode: Mode) -> None:
    flying.pilot.select(Mode.OFFBOARD, {})
    assert flying.do(command, *params).result == ACCEPTED
    assert flying.pilot.state == State(mode, armed=True)


@pytest.mark.parametrize("mode", Mode)
def test_do_set_mode_takes_every_number_of_the_table(flying: Cockpit, mode: Mode) -> None:
    flying.unmet = ()
    row = ROWS[mode]
    assert flying.do("DO_SET_MODE", CUSTOM, float(row.main), float(row.sub)).result == ACCEPTED
    assert flying.pilot.state.mode is mode
    assert flying.commands.set_custom_mode(int(CUSTOM), custom_mode(Mode.LAND)) is None
    assert flying.pilot.state.mode is Mode.LAND


@pytest.mark.parametrize(
    ("params", "first"), [((), 1), ((-1.0, 0.0), 1), ((0.0,), 0), ((2.0, 2.0), 2), ((3.0,), None), ((0.0, 1.0), None)]
)
def test_a_mission_starts_at_its_first_item(flying: Cockpit, params: tuple[float, ...], first: int | None) -> None:
    flying.load(MISSION, *[item("NAV_WAYPOINT", place=(20.0, north, 10.0)) for north in (0.0, 5.0, 10.0)])
    flying.missions.executor.set_current(1, False)
    outcome = flying.do("MISSION_START", *params)
    assert outcome.result == (DENIED if first is None else ACCEPTED)
    assert ("item" in outcome.reason) is (first is None)
    assert flying.missions.executor.progress.seq == (1 if first is None else first)
    flying.load(MISSION)
    assert flying.do("MISSION_START").reason == "mission refused: there is no mission"


@pytest.mark.parametrize(
    ("command", "params", "result"),
    [
        ("COMPONENT_ARM_DISARM", (0.0,), DENIED),
        ("COMPONENT_ARM_DISARM", (2.0,), DENIED),
        ("DO_SET_MODE", (CUSTOM, 77.0, 0.0), UNSUPPORTED),
        ("DO_SET_MODE", (CUSTOM, 0.5, 0.0), DENIED),
        ("DO_SET_MODE", (CUSTOM, nan, 0.0), DENIED),
        ("DO_SET_MODE", (0.0, 4.0, 3.0), UNSUPPORTED),
        ("DO_PAUSE_CONTINUE", (2.0,), DENIED),
        ("DO_REPOSITION", (-1.0, 2.0), DENIED),
        ("DO_REPOSITION", (-1.0, 0.0, 0.0, 20.0), DENIED),
        ("DO_REPOSITION", (99.0,), DENIED),
        ("DO_ORBIT", (0.5,), DENIED),
        ("DO_ORBIT", (1e6,), DENIED),
        ("DO_ORBIT", (5.0, 99.0), DENIED),
        ("DO_ORBIT", (8.0, 1.0, 17.0), DENIED),
        ("DO_CHANGE_SPEED", (1.0, 99.0), DENIED),
        ("DO_CHANGE_SPEED", (1.0, -5.0), DENIED),
        ("DO_CHANGE_SPEED", (2.0, 5.0), UNSUPPORTED),
        ("DO_CHANGE_SPEED", (1.0, 5.0, 0.0, 1.0), UNSUPPORTED),
        ("DO_SET_HOME", (2.0,), DENIED),
        ("DO_SET_HOME", (0.0,), DENIED),
        ("DO_FLIGHTTERMINATION", (0.0,), DENIED),
        ("CONDITION_YAW", (nan,), DENIED),
        ("CONDITION_YAW", (400.0,), DENIED),
        ("CONDITION_YAW", (90.0, 0.0, 3.0), DENIED),
        ("CONDITION_YAW", (90.0, 0.0, 1.0, 2.0), DENIED),
    ],
)
def test_bad_numbers_change_nothing(flying: Cockpit, command: str, params: tuple[float, ...], result: int) -> None:
    state, task, home = flying.pilot.state, flying.pilot.task, flying.home.position_enu_m
    outcome = flying.do(command, *params)
    named = {f"{value:g}" for value in params} & {*outcome.reason.replace(",", "").split()}
    assert outcome.result == result
    assert named if params != (0.0,) else outcome.reason
    assert (flying.pilot.state, flying.home.position_enu_m, flying.pilot.speed_m_s) == (state, home, None)
    assert flying.pilot.task is task


@pytest.mark.parametrize("command", ["DO_REPOSITION", "DO_ORBIT"])
@pytest.mark.parametrize("place", [{"x": 91.0, "y": 8.0}, {"x": 47.0}, {"x": inf, "y": 8.0}, {"x": 0.0, "y": 0.0}])
def test_nowhere_is_flown_to(flying: Cockpit, command: str, place: dict[str, float]) -> None:
    assert flying.do(command, frame=mav.MAV_FRAME_GLOBAL, **place).result == DENIED
    assert flying.pilot.state.mode is Mode.HOLD


@pytest.mark.parametrize(
    ("command", "params", "result"),
    [("DO_REPOSITION", (3.0,), DENIED), ("DO_ORBIT", (), DENIED), ("CONDITION_YAW", (90.0,), TEMPORARILY_REJECTED)],
)
def test_what_stands_is_not_sent_anywhere(
    standing: Cockpit, command: str, params: tuple[float, ...], result: int
) -> None:
    outcome = standing.do(command, *params, z=5.0)
    assert outcome.result == result
    assert "the vehicle is not flying" in outcome.reason
    assert standing.pilot.state == FIRST


def test_arming_and_disarming(standing: Cockpit) -> None:
    assert standing.do("COMPONENT_ARM_DISARM", 1.0).result == ACCEPTED
    assert standing.do("COMPONENT_ARM_DISARM", 1.0).result == ACCEPTED
    assert standing.pilot.ground.times.flights == 1
    assert standing.do("COMPONENT_ARM_DISARM", 0.0).result == ACCEPTED
    standing.stock(charge=0.0)
    assert standing.do("COMPONENT_ARM_DISARM", 1.0).result == DENIED
    assert standing.do("RUN_PREARM_CHECKS").result == FAILED
    assert standing.do("COMPONENT_ARM_DISARM", 1.0, FORCE).result == ACCEPTED
    standing.stock()
    assert standing.do("RUN_PREARM_CHECKS").result == ACCEPTED


def test_in_flight_rotors_stop_by_force_or_termination(flying: Cockpit) -> None:
    assert flying.do("COMPONENT_ARM_DISARM", 0.0).result == DENIED
    assert flying.do("DO_FLIGHTTERMINATION", 1.0).result == ACCEPTED
    assert not flying.pilot.state.armed


@pytest.mark.parametrize(
    ("params", "frame", "z", "height_m"),
    [
        ((), None, nan, 2.5),
        ((), None, 7.0, 7.0),
        ((0.0,), mav.MAV_FRAME_GLOBAL_RELATIVE_ALT, 7.0, 7.0),
        ((-1.0,), None, 507.0, None),
        ((0.0,), mav.MAV_FRAME_GLOBAL, 507.0, None),
    ],
)
def test_a_takeoff_climbs_to_the_height_that_is_meant(
    standing: Cockpit, params: tuple[float, ...], frame: int | None, z: float, height_m: float | None
) -> None:
    assert standing.do("NAV_TAKEOFF", *params, frame=frame, z=z).result == ACCEPTED
    task = standing.pilot.task
    assert isinstance(task, TakeoffTask)
    above_sea_m = z - standing.home.origin.altitude_m
    assert task.order.height_enu_m == pytest.approx(above_sea_m if height_m is None else height_m)


@pytest.mark.parametrize("z", [0.0, -3.0, 0.1, inf, 2e4])
def test_a_takeoff_to_no_height_is_denied(standing: Cockpit, z: float) -> None:
    outcome = standing.do("NAV_TAKEOFF", z=z)
    assert (outcome.result, f" {z:g} m above the ground" in outcome.reason) == (DENIED, True)
    assert isinstance(standing.pilot.task, HoldTask)


def test_places_heights_and_headings_of_a_reposition(flying: Cockpit) -> None:
    there = flying.place(30.0, 40.0)
    frame = mav.MAV_FRAME_GLOBAL_RELATIVE_ALT
    params = (3.0, 1.0, 0.0, radians(90.0))
    assert flying.do("DO_REPOSITION", *params, frame=frame, x=there.latitude_deg, y=there.longitude_deg, z=12.0)
    task = flying.pilot.task
    assert isinstance(task, GoToTask)
    assert task.order.position_enu_m == pytest.approx((30.0, 40.0, 12.0), abs=0.01)
    assert task.order.yaw_rad == pytest.approx(0.0)
    assert task.order.speed_m_s == 3.0
    assert flying.do("DO_REPOSITION", z=15.0 + flying.home.origin.altitude_m).result == ACCEPTED
    assert isinstance(flying.pilot.task, GoToTask)
    assert flying.pilot.task.order.position_enu_m == pytest.approx((0.0, 0.0, 15.0), abs=0.01)


@pytest.mark.parametrize("by", ["command", "item"])
@pytest.mark.parametrize(
    ("angle", "way", "relative", "turned"),
    [
        (180.0, 0.0, 0.0, 90.0),
        (180.0, 1.0, 0.0, 90.0),
        (180.0, -1.0, 0.0, -270.0),
        (80.0, 1.0, 0.0, 350.0),
        (90.0, -1.0, 0.0, 0.0),
        (350.0, 1.0, 1.0, 350.0),
        (200.0, -1.0, 1.0, -200.0),
        (-90.0, 1.0, 1.0, -90.0),
    ],
)
def test_turns_go_the_way_that_is_asked_for(by: str, angle: float, way: float, relative: float, turned: float) -> None:
    """The vehicle heads east; clockwise is positive."""
    cockpit = Cockpit(FLYING)
    cockpit.step()
    if by == "command":
        assert cockpit.do("CONDITION_YAW", angle, 0.0, way, relative).result == ACCEPTED
    else:
        turn = item("CONDITION_YAW", angle, 0.0, way, relative)
        cockpit.load(MISSION, turn, item("NAV_LOITER_UNLIM", 0.0, 0.0, 0.0, nan, place=FLYING))
        cockpit.pilot.select(Mode.MISSION, {})
    yaw, total = cockpit.state.euler[2], 0.0
    for _ in range(500):
        cockpit.step()
        before, yaw = yaw, cockpit.state.euler[2]
        total -= degrees(remainder(yaw - before, tau))
    assert total == pytest.approx(turned, abs=6.0 if by == "item" else 1.0)


def test_the_speed_that_is_asked_for(flying: Cockpit) -> None:
    assert flying.do("DO_CHANGE_SPEED", 1.0, 4.0).result == ACCEPTED
    assert flying.pilot.speed_m_s == 4.0
    assert flying.do("DO_CHANGE_SPEED", 1.0, -1.0).result == ACCEPTED
    assert flying.pilot.speed_m_s == 4.0
    assert flying.do("DO_CHANGE_SPEED", 1.0, -2.0).result == ACCEPTED
    assert flying.pilot.speed_m_s is None


def test_home_here_there_and_too_far_away(flying: Cockpit) -> None:
    assert flying.do("DO_SET_HOME", 1.0).result == ACCEPTED
    assert flying.home.position_enu_m == pytest.approx(FLYING, abs=0.01)
    there = flying.place(5.0, 6.0)
    altitude_m = flying.home.origin.altitude_m
    outcome = flying.do("DO_SET_HOME", 0.0, x=there.latitude_deg, y=there.longitude_deg, z=altitude_m + 1.0)
    assert outcome.result == ACCEPTED
    assert flying.home.position_enu_m == pytest.approx((5.0, 6.0, 1.0), abs=0.01)
    assert flying.home.chosen
    far = Geodetic(there.latitude_deg + 5.0, there.longitude_deg, altitude_m)
    assert flying.commands.move_home(far) == Refusal("home refused: 556 km away, more than 100")


@pytest.mark.parametrize("command", ["DO_REPOSITION", "DO_ORBIT"])
def test_no_command_leads_below_the_ground(flying: Cockpit, command: str) -> None:
    sea_m = flying.home.origin.altitude_m
    outcome = flying.do(command, z=sea_m - 3.0)
    assert (outcome.result, "3.0 m below the ground" in outcome.reason) == (DENIED, True)
    assert flying.do(command, z=sea_m).result == ACCEPTED


def test_no_command_leads_over_the_fence() -> None:
    cockpit = Cockpit(FLYING, behaviour=Behaviour(max_distance_m=15.0))
    cockpit.step()
    there = cockpit.place(20.0, 0.0)
    assert "15 m from home" in cockpit.do("DO_REPOSITION", frame=0, x=there.latitude_deg, y=there.longitude_deg).reason
    assert "15 m from home" in cockpit.do("DO_ORBIT", 16.0, 2.0).reason
    refusal = cockpit.commands.motion.guided_goto(there.latitude_deg, there.longitude_deg, 10.0, 3)
    assert refusal is not None
    assert "15 m from home" in refusal.reason
    centre = item("NAV_FENCE_CIRCLE_EXCLUSION", 3.0, place=(8.0, 0.0, 0.0))
    cockpit.load(FENCE, centre)
    inside = cockpit.place(8.0, 0.0)
    outcome = cockpit.do("DO_REPOSITION", frame=0, x=inside.latitude_deg, y=inside.longitude_deg)
    assert outcome.reason == "reposition refused: outside the geofence"
    assert cockpit.pilot.state.mode is Mode.HOLD


ANYTHING = st.one_of(st.floats(width=32), st.sampled_from([0.0, 1.0, -1.0, nan, 47.4, 8.5]))


@settings(max_examples=100)
@given(
    st.integers(0, 14),
    st.tuples(*(ANYTHING for _ in range(7))),
    st.one_of(st.none(), st.sampled_from([0, 2, 3, 5, 6])),
    st.booleans(),
)
def test_any_command_is_answered_and_the_flight_goes_on(
    index: int, numbers: tuple[float, ...], frame: int | None, flies: bool
) -> None:
    cockpit = AIRBORNE if flies else AT_REST
    handlers = list(cockpit.commands.handlers().items())
    number, handler = handlers[index % len(handlers)]
    p1, p2, p3, p4, x, y, z = numbers
    refusal = handler(ReceivedCommand(number, p1, p2, p3, p4, x, y, z, frame, GROUND, cockpit.now_us))
    if refusal is not None:
        assert refusal.reason
        assert refusal.result in (DENIED, FAILED, UNSUPPORTED, TEMPORARILY_REJECTED)
    cockpit.step()


AIRBORNE, AT_REST = Cockpit(FLYING), Cockpit()
