"""The supervisor alone: for each condition and each choice of action, what begins, is said and remembered."""

import pytest

from colibri.autopilot.commander.rules.failsafe_conditions import FailsafeInputs
from colibri.autopilot.commander.rules.failsafe_parameters import settings
from colibri.autopilot.commander.rules.failsafe_rule import FailsafeMemory, FlightState
from colibri.autopilot.commander.rules.failsafe_table import NAMES, TABLE, Action, Condition, FailsafeRow
from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.commander.status_queue import StatusQueue
from colibri.autopilot.commander.supervisor import Supervisor
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.parameters.definitions import definitions
from colibri.mavlink.parameters.store import Parameters
from colibri.mavlink.wire.dialect import mav
from colibri.plant.vehicle.description import load_vehicle
from tests.support.failsafe_inputs import FULL, LOST, WELL

HOLDING = FlightState(armed=True, standing=False, mode=Mode.HOLD, saving=Action.NONE)
DEFINITIONS = definitions(load_profile("flight"), load_vehicle("hummingbird"))
CHOICES = [
    (row, value, action) for row in TABLE if row.condition in LOST and row.parameter for value, action in row.choices
]


def supervisor(**values: int) -> tuple[Supervisor, StatusQueue]:
    parameters, lines = Parameters(DEFINITIONS), StatusQueue()
    for name, value in values.items():
        assert parameters.set(name, value) is None
    return Supervisor(parameters, lines), lines


def look(of: Supervisor, inputs: FailsafeInputs, flight: FlightState = HOLDING, for_s: float = 100.0) -> list[Action]:
    """Show it the same for a while; return what begins."""
    times = range(inputs.now_us, inputs.now_us + round(for_s * 1e6), 500_000)
    begun = [of.step(inputs._replace(now_us=now_us), flight) for now_us in times]
    return [action for action in begun if action is not Action.NONE]


@pytest.mark.parametrize(
    ("row", "value", "action"), CHOICES, ids=[f"{row.condition}: {NAMES[action]}" for row, _, action in CHOICES]
)
def test_what_is_lost_begins_what_its_parameter_says(row: FailsafeRow, value: int, action: Action) -> None:
    saves, lines = supervisor(**{row.parameter: value})
    begun = look(saves, LOST[row.condition])
    texts = [text for _, text in lines.take()]
    if action in (Action.NONE, Action.WARN):
        assert action not in begun
    else:
        assert action in begun
        assert not row.reported or any(f": {row.condition}, " in text for text in texts)
    assert all(len(text) <= 50 for text in texts)  # one STATUSTEXT
    assert saves.holds(row.condition) is (action is not Action.NONE)


@pytest.mark.parametrize("condition", LOST)
def test_a_failsafe_begins_once_and_survives_a_restart(condition: Condition) -> None:
    first, _ = supervisor()
    begun = look(first, LOST[condition])
    assert look(first, LOST[condition]._replace(now_us=WELL.now_us + 100_000_000)) == []
    again, _ = supervisor()
    again.memory = first.memory
    assert again.holds(condition) is first.holds(condition)
    assert len(begun) <= 1 or condition is Condition.BATTERY_EMERGENCY


@pytest.mark.parametrize(
    ("remaining", "state"),
    [
        (0.9, mav.MAV_BATTERY_CHARGE_STATE_OK),
        (0.14, mav.MAV_BATTERY_CHARGE_STATE_LOW),
        (0.06, mav.MAV_BATTERY_CHARGE_STATE_CRITICAL),
        (0.01, mav.MAV_BATTERY_CHARGE_STATE_EMERGENCY),
    ],
)
def test_the_charge_state_is_that_of_the_failsafes(remaining: float, state: int) -> None:
    watches, _ = supervisor()
    look(watches, WELL._replace(battery=FULL._replace(remaining=remaining)))
    assert watches.charge_state == state


def test_parameters_are_gone_by_once_they_are_adopted() -> None:
    parameters, lines = Parameters(DEFINITIONS), StatusQueue()
    watches = Supervisor(parameters, lines)
    assert watches.memory == FailsafeMemory()
    parameters.set("BAT_LOW_THR", 0.2)
    inputs = WELL._replace(battery=FULL._replace(remaining=0.19))
    look(watches, inputs)
    assert not watches.holds(Condition.BATTERY_LOW)
    watches.adopt(parameters)
    look(watches, inputs)
    assert watches.holds(Condition.BATTERY_LOW)
    assert settings(parameters)
