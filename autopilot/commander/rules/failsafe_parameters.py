"""Parameters of the failsafes, under PX4's names where the meaning is the same."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TypeAlias

from colibri.autopilot.commander.rules.failsafe_rule import FailsafeSetting
from colibri.autopilot.commander.rules.failsafe_table import NAMES, TABLE, Action, Condition
from colibri.mavlink.parameters.numbers import Number, read_numbers
from colibri.mavlink.parameters.store import Parameter, Parameters

Limits: TypeAlias = Mapping[str, float]
"""Parameter name -> value, in the parameter's unit."""

GROUP = "Failsafes"
_US = 1e6
_CHOICES = {row.parameter: row for row in TABLE}
_LINES = read_numbers(Path(__file__).with_name("failsafe_parameters.csv"))
NUMBERS = tuple(line for line in _LINES if line.name not in _CHOICES)
"""Limits and delays; the other lines are actions, whose numbers are in the table of failsafes."""
ELSEWHERE = ("COM_OF_LOSS_T", "COM_RC_LOSS_T")  # delays defined with the behaviour, because modes use them
_COPTER_ACTIONS = {Condition.BATTERY_LOW: "BATT_FS_LOW_ACT", Condition.BATTERY_CRITICAL: "BATT_FS_CRT_ACT"}
_COPTER_BATTERY = (
    *(Action.WARN, Action.LAND, Action.RETURN, Action.RETURN),
    *(Action.LAND, Action.TERMINATE, Action.RETURN, Action.HOLD),
)
"""Actions by ArduCopter's parameters, where they are defined."""


@cache
def failsafe_parameters() -> tuple[Parameter, ...]:
    return tuple(_action(line) if line.name in _CHOICES else line.parameter(line.default, GROUP) for line in _LINES)


def _action(line: Number) -> Parameter:
    row = _CHOICES[line.name]
    numbers = [number for number, _ in row.choices]
    values = line.values or tuple((number, NAMES[action].capitalize()) for number, action in row.choices)
    bounded = line._replace(minimum=min(numbers), maximum=max(numbers), values=values)
    return bounded.parameter(row.default, GROUP)


def limits(parameters: Parameters) -> Limits:
    """Return limits and delays; unchanged numbers keep 64 bits."""
    found: dict[str, float] = {}
    for number in NUMBERS:
        value = parameters[number.name]
        found[number.name] = number.default if value == parameters.default(number.name) else value
    for name in ELSEWHERE:
        found[name] = parameters[name]
    return found


def settings(parameters: Parameters) -> dict[Condition, FailsafeSetting]:
    known = limits(parameters)
    by_identity = {
        condition: _COPTER_BATTERY[int(parameters[name])]
        for condition, name in _COPTER_ACTIONS.items()
        if name in parameters
    }
    return {
        row.condition: FailsafeSetting(
            round(known[row.delay] * _US) if row.delay else 0,
            by_identity.get(row.condition) or dict(row.choices)[int(parameters[row.parameter])],
        )
        for row in TABLE
    }
