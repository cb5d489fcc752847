"""The table of flight modes and that of transitions: every row, every mode, and the page that is drawn from them."""

from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.autopilot.commander.rules.modes import (
    FIRST,
    MODES,
    ROWS,
    TRANSITIONS,
    Event,
    Mode,
    Need,
    State,
    Transition,
    custom_mode,
    mode_of,
    mode_of_custom,
    next_state,
)
from colibri.mavlink.wire.dialect import Refusal


def test_every_mode_has_one_row_and_one_number() -> None:
    assert [row.mode for row in MODES] == list(Mode)
    assert len({custom_mode(mode) for mode in Mode}) == len(Mode)
    for mode in Mode:
        assert mode_of_custom(custom_mode(mode)) is mode
        assert mode_of(ROWS[mode].main, ROWS[mode].sub) is mode


def test_numbers_are_those_of_px4() -> None:
    assert custom_mode(Mode.HOLD) == 4 << 16 | 3 << 24
    assert custom_mode(Mode.OFFBOARD) == 6 << 16
    assert mode_of(1, 0) is Mode.STABILIZED  # PX4's manual


@given(st.integers(0, 2**32 - 1))
def test_a_number_is_a_mode_of_the_table_or_none(number: int) -> None:
    mode = mode_of_custom(number)
    assert mode is None or custom_mode(mode) == number or (mode is Mode.STABILIZED and number == 1 << 16)


def test_standard_modes_name_one_mode_each() -> None:
    standards = [row.standard for row in MODES if row.standard]
    assert len(standards) == len(set(standards)) == 7


@pytest.mark.parametrize("row", TRANSITIONS, ids=lambda row: f"{'-'.join(row.sources) or 'any'}: {row.event}")
def test_every_transition_leads_where_its_row_says(row: Transition) -> None:
    first = next(one for one in TRANSITIONS if one.event is row.event)
    for mode in row.sources or Mode:
        if row is not first and mode in first.sources:
            continue  # an earlier row takes it
        if row.event is Event.ARM and not ROWS[mode].to_arm:
            continue
        selected = Mode.HOLD if row.event is Event.SELECT else None
        after = next_state(State(mode, armed=row.event is not Event.ARM), row.event, selected, {})
        assert isinstance(after, State)
        expected = row.target or selected or mode
        assert after == State(expected, armed=not row.disarms)


@pytest.mark.parametrize("armed", [False, True])
@pytest.mark.parametrize("event", Event)
def test_events_without_a_row_are_refused(event: Event, armed: bool) -> None:
    for mode in Mode:
        rows = [row for row in TRANSITIONS if row.event is event and (not row.sources or mode in row.sources)]
        after = next_state(State(mode, armed), event, None, {})
        if not any(armed or not row.armed for row in rows):
            assert isinstance(after, Refusal)
        elif isinstance(after, State):
            assert after.mode in Mode
            assert after.armed <= (armed or event is Event.ARM)


def test_nothing_but_arming_arms() -> None:
    for mode, event, selected in product(Mode, Event, (None, *Mode)):
        after = next_state(State(mode, armed=False), event, selected, {})
        assert event is Event.ARM or isinstance(after, Refusal) or not after.armed


@pytest.mark.parametrize("mode", Mode)
def test_a_mode_is_refused_by_its_first_missing_need(mode: Mode) -> None:
    flying = State(Mode.LAND, armed=True)
    assert next_state(flying, Event.SELECT, mode, {}) == State(mode, armed=True)
    for need in ROWS[mode].needs:
        refusal = next_state(flying, Event.SELECT, mode, {need: "why"})
        assert isinstance(refusal, Refusal)
        assert "why" in refusal.reason
    others = {need: "" for need in Need if need not in ROWS[mode].needs}
    assert next_state(flying, Event.SELECT, mode, others) == State(mode, armed=True)


@pytest.mark.parametrize("mode", Mode)
def test_on_the_ground_needs_hold_back_arming_and_not_the_choice(mode: Mode) -> None:
    needs = dict.fromkeys(ROWS[mode].needs, "why")
    chosen = next_state(FIRST, Event.SELECT, mode, needs)
    assert isinstance(chosen, State) is ROWS[mode].selectable
    armed = next_state(State(mode, armed=False), Event.ARM, None, needs)
    assert isinstance(armed, State) is (ROWS[mode].to_arm and not needs)
