"""The rule of the failsafes: which action begins, given since when each condition holds.

The actions are ranked; what is flown gives way to a higher one alone, until the pilot chooses a mode or the rotors
stop.
"""

from collections.abc import Mapping
from typing import NamedTuple

from colibri.autopilot.commander.rules.failsafe_table import NAMES, ROWS, TABLE, Action, Condition, Row
from colibri.autopilot.commander.rules.modes import Mode
from colibri.mavlink.services.statustext import CRITICAL, EMERGENCY, NOTICE, WARNING

CLEAR_AFTER_US = 1_000_000
"""How long a condition must not hold before it is over: a link that comes and goes is lost once."""

_SEVERITIES: Mapping[Action, int] = {
    Action.WARN: WARNING,
    Action.HOLD: WARNING,
    Action.RETURN: CRITICAL,
    Action.LAND: CRITICAL,
    Action.DESCEND: CRITICAL,
    Action.TERMINATE: EMERGENCY,
}
_RANKS: Mapping[Mode, Action] = {Mode.RETURN: Action.RETURN, Mode.LAND: Action.LAND}


class Setting(NamedTuple):
    """What the parameters make of a row: how long its condition must hold, and what is then done."""

    delay_us: int
    action: Action


class Flight(NamedTuple):
    """State of the flight that the rule decides about; `saving` is the failsafe that is flown, NONE if none is."""

    armed: bool
    standing: bool
    mode: Mode
    saving: Action

    @property
    def rank(self) -> Action:
        """What the vehicle does anyway: who returns need not hold, who lands need not return."""
        return max(self.saving, _RANKS.get(self.mode, Action.NONE))


class Memory(NamedTuple):
    """Memory from one control sample to the next.

    Attributes:
        held_us: When each condition that goes on, beyond its delay, last held.
        armed: Whether the rotors were armed.
    """

    held_us: Mapping[Condition, int] = {}
    armed: bool = False


class Verdict(NamedTuple):
    """Decision of the rule.

    Attributes:
        memory: For the next control sample.
        action: To begin now; NONE to go on as before.
        lines: MAV_SEVERITY and text of each line to report.
    """

    memory: Memory
    action: Action
    lines: tuple[tuple[int, str], ...]


def following(
    memory: Memory,
    now_us: int,
    since_us: Mapping[Condition, int],
    settings: Mapping[Condition, Setting],
    flight: Flight,
) -> Verdict:
    """Return what begins and what is over.

    An action begins with its condition: a pilot who then chooses another mode is obeyed until another condition
    begins. At each arming all that holds begins again. `since_us` has no entry for a condition that does not hold.
    """
    newly_armed = flight.armed and not memory.armed
    held_us: dict[Condition, int] = {
        condition: at_us
        for condition, at_us in memory.held_us.items()
        if not newly_armed and (flight.armed or ROWS[condition].grounded)
    }
    begun: list[Row] = []
    cleared: list[tuple[int, str]] = []
    for row in TABLE:
        condition = row.condition
        began_us = since_us.get(condition)
        if began_us is None and condition not in held_us:
            continue
        setting = settings[condition]
        holds = began_us is not None and now_us - began_us > setting.delay_us
        if holds and setting.action is not Action.NONE and (flight.armed or row.grounded):
            if condition not in held_us:
                begun.append(row)
            held_us[condition] = now_us
        elif now_us - held_us.get(condition, now_us) >= CLEAR_AFTER_US and not (row.kept and flight.armed):
            del held_us[condition]
            cleared.append((NOTICE, f"{condition}: cleared"))
    if not begun:
        return Verdict(Memory(held_us, flight.armed), Action.NONE, tuple(cleared))
    action, lines = _begin([(row, settings[row.condition].action) for row in begun], flight)
    return Verdict(Memory(held_us, flight.armed), action, (*lines, *cleared))


def _begin(begun: list[tuple[Row, Action]], flight: Flight) -> tuple[Action, list[tuple[int, str]]]:
    """Return the highest action that goes beyond what is flown, and the line to report of each condition."""
    begins, lines = Action.NONE, []
    for row, wanted in sorted(begun, key=lambda each: -each[1]):
        action = _fitting(wanted, flight)
        if action is Action.WARN:
            lines.append((WARNING, f"{row.condition}: {row.warns}" if row.warns else str(row.condition)))
        elif action > max(begins, flight.rank):
            begins = action
            if row.reported:
                lines.append((_SEVERITIES[action], f"{row.condition}: {NAMES[action]}"))
        elif row.reported:
            lines.append((WARNING, f"{row.condition}: {NAMES[max(begins, flight.rank)]} goes on"))
    return begins, lines


def _fitting(action: Action, flight: Flight) -> Action:
    if action is Action.WARN or not flight.armed:
        return Action.WARN
    return Action.TERMINATE if flight.standing else action
