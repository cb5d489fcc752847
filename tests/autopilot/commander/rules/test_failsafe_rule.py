"""The failsafes' table and the rule over it: the higher rank wins, nothing is downgraded, and what is over is said."""

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.autopilot.commander.rules.failsafe_parameters import NUMBERS, limits, settings
from colibri.autopilot.commander.rules.failsafe_rule import (
    CLEAR_AFTER_US,
    FailsafeDecision,
    FailsafeMemory,
    FailsafeSetting,
    FlightState,
    following,
)
from colibri.autopilot.commander.rules.failsafe_table import NAMES, ROWS, TABLE, Action, Condition, FailsafeRow
from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.parameters.definitions import definitions
from colibri.mavlink.parameters.store import Parameters
from colibri.mavlink.services.statustext import CRITICAL, EMERGENCY, NOTICE, WARNING
from colibri.plant.vehicle.description import load_vehicle
from tools.pages.failsafes import tables
from tools.pages.tables import with_tables

PAGE = Path(__file__).parents[4] / "docs" / "failsafes.md"
SECOND_US = 1_000_000
NOW_US = 100 * SECOND_US
IN_FLIGHT = FlightState(armed=True, standing=False, mode=Mode.MISSION, saving=Action.NONE)
ARMED = FailsafeMemory(armed=True)
CONDITIONS = st.sampled_from(list(Condition))
ACTIONS = st.sampled_from(list(Action))


def everything(action: Action, delay_us: int = 0) -> dict[Condition, FailsafeSetting]:
    return dict.fromkeys(Condition, FailsafeSetting(delay_us, action))


def begun(wanted: Mapping[Condition, Action], flight: FlightState = IN_FLIGHT) -> FailsafeDecision:
    set_to = {condition: FailsafeSetting(0, wanted.get(condition, Action.NONE)) for condition in Condition}
    return following(ARMED, NOW_US, dict.fromkeys(wanted, NOW_US - SECOND_US), set_to, flight)


def test_parameters_make_the_settings() -> None:
    parameters = Parameters(definitions(load_profile("flight"), load_vehicle("hummingbird")))
    assert settings(parameters)[Condition.SETPOINTS_LOST] == FailsafeSetting(SECOND_US, Action.HOLD)
    assert settings(parameters)[Condition.STATION_LOST] == FailsafeSetting(10 * SECOND_US, Action.NONE)
    parameters.set("NAV_DLL_ACT", 2)
    parameters.set("COM_DL_LOSS_T", 20.0)
    parameters.set("COM_LOW_BAT_ACT", 1)
    set_to = settings(parameters)
    assert set_to[Condition.STATION_LOST] == FailsafeSetting(20 * SECOND_US, Action.RETURN)
    assert set_to[Condition.BATTERY_LOW].action is Action.RETURN
    assert set_to[Condition.BATTERY_CRITICAL].action is Action.LAND
    assert {number.name for number in NUMBERS} <= set(limits(parameters))


@pytest.mark.parametrize("action", [action for action in Action if action > Action.WARN])
def test_what_begins_is_done_and_said(action: Action) -> None:
    memory, done, said = begun({Condition.STATION_LOST: action})
    assert done is action
    severity = {Action.HOLD: WARNING, Action.TERMINATE: EMERGENCY}.get(action, CRITICAL)
    assert said == ((severity, f"Failsafe activated: ground station lost, {NAMES[action]}"),)
    again = following(memory, NOW_US + 8000, {Condition.STATION_LOST: 0}, everything(action), IN_FLIGHT)
    assert again.action is Action.NONE
    assert again.lines == ()


@given(st.dictionaries(CONDITIONS, ACTIONS))
def test_of_all_that_begin_the_highest_is_done_and_each_is_said(wanted: dict[Condition, Action]) -> None:
    _, done, said = begun(wanted)
    highest = max(wanted.values(), default=Action.NONE)
    assert done is (highest if highest > Action.WARN else Action.NONE)
    heard = [each for each, action in wanted.items() if action is Action.WARN or (action and ROWS[each].reported)]
    assert sorted(text.split(": ")[1].split(",")[0] for _, text in said) == sorted(heard)


@given(st.lists(st.tuples(CONDITIONS, ACTIONS), max_size=12), st.sampled_from(list(Mode)))
def test_nothing_that_begins_later_downgrades(each: list[tuple[Condition, Action]], mode: Mode) -> None:
    """One after another, with nobody choosing a mode: ranks rise, and what is flown is the highest of all."""
    memory, saving, ranks = ARMED, Action.NONE, [IN_FLIGHT._replace(mode=mode).rank]
    since: dict[Condition, int] = {}
    set_to = everything(Action.NONE)
    for step, (condition, action) in enumerate(each):
        if condition in since:
            continue
        since[condition] = NOW_US + step * 8000 - SECOND_US
        set_to[condition] = FailsafeSetting(0, action)
        flight = IN_FLIGHT._replace(mode=mode, saving=saving)
        memory, done, _ = following(memory, NOW_US + step * 8000, since, set_to, flight)
        saving = done if done is not Action.NONE else saving
        ranks.append(IN_FLIGHT._replace(mode=mode, saving=saving).rank)
    assert all(before <= after for before, after in pairwise(ranks))
    wanted = [setting.action for setting in set_to.values() if setting.action > Action.WARN]
    assert ranks[-1] == max([ranks[0], *wanted])


def test_who_lands_need_not_return_and_it_is_said() -> None:
    for flight in (IN_FLIGHT._replace(mode=Mode.LAND), IN_FLIGHT._replace(saving=Action.LAND)):
        _, done, said = begun({Condition.STATION_LOST: Action.RETURN}, flight)
        assert done is Action.NONE
        assert said == ((WARNING, "Failsafe: ground station lost, land continues"),)
    assert begun({Condition.POSITION_LOST: Action.DESCEND}, flight).action is Action.DESCEND


@given(st.integers(0, 60 * SECOND_US), st.integers(0, 120 * SECOND_US))
def test_a_condition_must_outlast_its_delay(delay_us: int, held_us: int) -> None:
    since = {Condition.STATION_LOST: NOW_US - held_us}
    done = following(ARMED, NOW_US, since, everything(Action.RETURN, delay_us), IN_FLIGHT).action
    assert done is (Action.RETURN if held_us > delay_us else Action.NONE)


def run(
    memory: FailsafeMemory, seconds: float, since: Mapping[Condition, int], action: Action, flight: FlightState
) -> list[str]:
    """Go on for so long; return all that is said, and keep `memory` in the last place."""
    said: list[str] = []
    for now_us in range(NOW_US, NOW_US + round(seconds * SECOND_US), 8000):
        memory, _, lines = following(memory, now_us, since, everything(action), flight)
        said += [text for severity, text in lines if severity == NOTICE]
    return said


@pytest.mark.parametrize("row", TABLE, ids=lambda row: row.condition)
def test_the_end_of_a_condition_is_reported_once(row: FailsafeRow) -> None:
    memory = begun({row.condition: Action.HOLD}).memory
    assert run(memory, 3.0, {}, Action.HOLD, IN_FLIGHT) == ([] if row.kept else [f"Failsafe cleared: {row.condition}"])


def test_a_link_that_comes_and_goes_is_lost_once() -> None:
    memory = ARMED
    said: list[tuple[int, str]] = []
    for step in range(40):
        now_us = NOW_US + step * SECOND_US // 4
        since = {Condition.STATION_LOST: now_us - SECOND_US} if step % 3 == 0 else {}
        memory, _, lines = following(memory, now_us, since, everything(Action.RETURN), IN_FLIGHT)
        said += lines
    assert len(said) == 1
    assert CLEAR_AFTER_US == SECOND_US


def test_a_pilots_choice_holds_until_another_condition_begins() -> None:
    memory = begun({Condition.BATTERY_CRITICAL: Action.LAND}).memory
    since = {Condition.BATTERY_CRITICAL: 0}
    chosen = IN_FLIGHT._replace(mode=Mode.HOLD)
    memory, done, said = following(memory, NOW_US + 8000, since, everything(Action.LAND), chosen)
    assert (done, said) == (Action.NONE, ())
    since[Condition.STATION_LOST] = 0
    assert following(memory, NOW_US + 16000, since, everything(Action.RETURN), chosen).action is Action.RETURN


@given(CONDITIONS, st.sampled_from([action for action in Action if action > Action.WARN]))
def test_on_the_ground_the_rotors_stop(condition: Condition, action: Action) -> None:
    _, done, said = begun({condition: action}, IN_FLIGHT._replace(standing=True, mode=Mode.HOLD))
    assert done is Action.TERMINATE
    assert said == (((EMERGENCY, f"Failsafe activated: {condition}, terminate"),) if ROWS[condition].reported else ())


@pytest.mark.parametrize("row", TABLE, ids=lambda row: row.condition)
def test_disarmed_only_grounded_rows_are_reported(row: FailsafeRow) -> None:
    lying = FlightState(armed=False, standing=True, mode=Mode.HOLD, saving=Action.NONE)
    _, done, said = following(FailsafeMemory(), NOW_US, {row.condition: 0}, everything(Action.LAND), lying)
    assert done is Action.NONE
    assert bool(said) is row.grounded
    assert all(severity == WARNING for severity, _ in said)


def test_all_that_holds_begins_anew_at_arming() -> None:
    lying = FlightState(armed=False, standing=True, mode=Mode.HOLD, saving=Action.NONE)
    since, set_to = {Condition.BATTERY_LOW: 0}, everything(Action.RETURN)
    memory = following(FailsafeMemory(), NOW_US, since, set_to, lying).memory
    assert Condition.BATTERY_LOW in memory.held_us
    assert following(memory, NOW_US + 8000, since, set_to, lying._replace(armed=True)).action is Action.TERMINATE


def test_in_flight_conditions_end_with_the_flight() -> None:
    memory = begun({Condition.STATION_LOST: Action.LAND, Condition.GPS_LOST: Action.HOLD}).memory
    lying = FlightState(armed=False, standing=True, mode=Mode.HOLD, saving=Action.NONE)
    after = following(memory, NOW_US + 8000, dict.fromkeys(Condition, 0), everything(Action.LAND), lying)
    assert set(after.memory.held_us) == {row.condition for row in TABLE if row.grounded}
    assert not any("cleared" in text for _, text in after.lines)


def test_rows_say_what_they_add_to_a_warning() -> None:
    text = "Warning: GPS lost, position by dead reckoning"
    assert begun({Condition.GPS_LOST: Action.WARN}).lines == ((WARNING, text),)
    assert ROWS[Condition.BATTERY_LOW].warns == ""
    assert begun({Condition.BATTERY_LOW: Action.WARN}).lines == ((WARNING, "Warning: battery low"),)


def test_the_page_is_current() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert page == with_tables(page, tables())
    assert f"ground station lost` {CLEAR_AFTER_US * 1e-6:g} s after the end of the condition" in page
