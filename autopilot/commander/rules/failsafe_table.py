"""The failsafes, a line each in `failsafe_table.csv`; source of `docs/failsafes.md`."""

import csv
from collections.abc import Mapping
from enum import IntEnum, StrEnum
from pathlib import Path
from typing import NamedTuple


class Action(IntEnum):
    """Action of a failsafe, ranked by its number."""

    NONE = 0
    WARN = 1
    HOLD = 2
    RETURN = 3
    LAND = 4
    DESCEND = 5
    TERMINATE = 6


NAMES = {action: action.name.lower() for action in Action} | {Action.NONE: "no action", Action.WARN: "warning"}
MEANINGS: Mapping[Action, str] = {
    Action.NONE: "neither action nor report",
    Action.WARN: "report only",
    Action.HOLD: "mode hold: stop and hold position",
    Action.RETURN: "mode return: climb, fly home, land",
    Action.LAND: "mode land: descend here, disarm",
    Action.DESCEND: "mode land without position: level at landing speed, drifting with the wind",
    Action.TERMINATE: "rotors stop at once, also in the air",
}


class Condition(StrEnum):
    """Condition of a failsafe; the value is the text for ground stations."""

    ATTITUDE_LOST = "attitude lost"
    TILTED = "tilted too far"
    ROTOR_FAILED = "rotor failed"
    POSITION_LOST = "position lost"
    ESTIMATE_INVALID = "estimate invalid"
    BATTERY_EMERGENCY = "battery nearly empty"
    BATTERY_CRITICAL = "battery critical"
    PLAN_FAILED = "no MPC solution"
    DEADLINE_MISSED = "deadline missed"
    TELEMETRY_MISSED = "telemetry missed"
    STATION_LOST = "ground station lost"
    FENCE_BREACHED = "geofence breached"
    GYROSCOPE_LOST = "gyroscope lost"
    ACCELEROMETER_LOST = "accelerometer lost"
    BAROMETER_LOST = "barometer lost"
    MAGNETOMETER_LOST = "magnetometer lost"
    GPS_LOST = "GPS lost"
    STICKS_LOST = "sticks lost"
    SETPOINTS_LOST = "setpoints lost"
    BATTERY_LOW = "battery low"


class FailsafeRow(NamedTuple):
    """A failsafe, `grounded` if watched on the ground, too, `kept` until the rotors stop, `reported` to stations."""

    condition: Condition
    holds: str
    limits: tuple[str, ...]
    delay: str
    parameter: str
    choices: tuple[tuple[int, Action], ...]
    default: int
    clears: str
    grounded: bool = False
    kept: bool = False
    warns: str = ""
    reported: bool = True


def _row(cells: Mapping[str, str]) -> FailsafeRow:
    choices = (choice.split("=") for choice in cells["choices"].split("|"))
    return FailsafeRow(
        Condition[cells["condition"]],
        cells["holds"],
        tuple(cells["limits"].split()),
        cells["delay"],
        cells["parameter"],
        tuple((int(number), Action[action]) for number, action in choices),
        int(cells["default"]),
        cells["clears"],
        grounded=bool(cells["grounded"]),
        kept=bool(cells["kept"]),
        warns=cells["warns"],
        reported=not cells["unreported"],
    )


with Path(__file__).with_suffix(".csv").open(encoding="utf-8", newline="") as _file:
    TABLE = tuple(map(_row, csv.DictReader(_file)))
ROWS: Mapping[Condition, FailsafeRow] = {row.condition: row for row in TABLE}
