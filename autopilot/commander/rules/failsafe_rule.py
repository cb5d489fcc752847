"""The failsafe rule: only a higher-ranked action replaces the active one."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from colibri.autopilot.commander.rules.failsafe_table import NAMES, ROWS, TABLE, Action, Condition, FailsafeRow
from colibri.autopilot.commander.rules.modes import Mode
from colibri.common.records import Record
from colibri.mavlink.services.statustext import CRITICAL, EMERGENCY, NOTICE, WARNING

CLEAR_AFTER_US = 1_000_000  # time until a condition is over, so that a flickering link is lost once

_ORDER = {row.condition: place for place, row in enumerate(TABLE)}
_SEVERITIES: Mapping[Action, int] = {
    Action.WARN: WARNING,
    Action.HOLD: WARNING,
    Action.RETURN: CRITICAL,
    Action.LAND: CRITICAL,
    Action.DESCEND: CRITICAL,
    Action.TERMINATE: EMERGENCY,
}
_RANKS: Mapping[Mode, Action] = {Mode.RETURN: Action.RETURN, Mode.LAND: Action.LAND}

_NOTHING: Mapping[Condition, str] = MappingProxyType({})


class FailsafeSetting(NamedTuple):
    delay_us: int
    action: Action


class FlightState(Record, frozen=True):
    """State of the flight; `saving` is the active failsafe."""

    armed: bool
    standing: bool
    mode: Mode
    saving: Action

    @property
    def rank(self) -> Action:
        """Action that the mode performs anyway."""
        return max(self.saving, _RANKS.get(self.mode, Action.NONE))


class FailsafeMemory(Record, frozen=True):
    """When each ongoing condition, past its delay, last held."""

    held_us: Mapping[Condition, int] = {}
    armed: bool = False


class FailsafeDecision(NamedTuple):
    """Action to begin, and MAV_SEVERITY and text of each report."""

    memory: FailsafeMemory
    action: Action
    lines: tuple[tuple[int, str], ...]


def following(
    memory: FailsafeMemory,
    now_us: int,
    since_us: Mapping[Condition, int],
    settings: Mapping[Condition, FailsafeSetting],
    flight: FlightState,
    exempt: Mapping[Condition, str] = _NOTHING,
) -> FailsafeDecision:
    """Decide which failsafes begin and end; arming restarts all holding conditions.

    `exempt` conditions are reported only, with what continues.

    An action begins with its condition: a mode selected later stays until another condition begins.
    """
    newly_armed = flight.armed and not memory.armed
    held_us: dict[Condition, int] = {
        condition: at_us
        for condition, at_us in memory.held_us.items()
        if not newly_armed and (flight.armed or ROWS[condition].grounded)
    }
    begun: list[FailsafeRow] = []
    cleared: list[tuple[int, str]] = []
    for condition in sorted({*since_us, *held_us}, key=_ORDER.__getitem__):
        row, setting, began_us = ROWS[condition], settings[condition], since_us.get(condition)
        holds = began_us is not None and now_us - began_us > setting.delay_us
        if holds and setting.action is not Action.NONE and (flight.armed or row.grounded):
            if condition not in held_us:
                begun.append(row)
            held_us[condition] = now_us
        elif now_us - held_us.get(condition, now_us) >= CLEAR_AFTER_US and not (row.kept and flight.armed):
            del held_us[condition]
            cleared.append((NOTICE, f"Failsafe cleared: {condition}"))
    if not begun:
        return FailsafeDecision(FailsafeMemory(held_us, flight.armed), Action.NONE, tuple(cleared))
    wanted = [(row, Action.WARN if row.condition in exempt else settings[row.condition].action) for row in begun]
    action, lines = _begin(wanted, flight, exempt)
    return FailsafeDecision(FailsafeMemory(held_us, flight.armed), action, (*lines, *cleared))


def _begin(
    begun: list[tuple[FailsafeRow, Action]], flight: FlightState, exempt: Mapping[Condition, str]
) -> tuple[Action, list[tuple[int, str]]]:
    begins, lines = Action.NONE, []
    for row, wanted in sorted(begun, key=lambda each: -each[1]):
        action = _fitting(wanted, flight)
        if action is Action.WARN:
            words = f"continuing {exempt[row.condition]}" if row.condition in exempt else row.warns
            lines.append((WARNING, f"Warning: {row.condition}" + (f", {words}" if words else "")))
        elif action > max(begins, flight.rank):
            begins = action
            if row.reported:
                lines.append((_SEVERITIES[action], f"Failsafe activated: {row.condition}, {NAMES[action]}"))
        elif row.reported:
            lines.append((WARNING, f"Failsafe: {row.condition}, {NAMES[max(begins, flight.rank)]} continues"))
    return begins, lines


def _fitting(action: Action, flight: FlightState) -> Action:
    if action is Action.WARN or not flight.armed:
        return Action.WARN
    return Action.TERMINATE if flight.standing else action
