"""The failsafes as a table of conditions and actions; source of `docs/failsafes.md`."""

from collections.abc import Mapping
from enum import IntEnum, StrEnum
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


NAMES: Mapping[Action, str] = {
    Action.NONE: "no action",
    Action.WARN: "warning",
    Action.HOLD: "hold",
    Action.RETURN: "return",
    Action.LAND: "land",
    Action.DESCEND: "descend",
    Action.TERMINATE: "terminate",
}
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
    """A failsafe; its texts and parameters appear on the page.

    Attributes:
        grounded: Whether it is also watched on the ground.
        kept: Whether it holds until the rotors stop.
        reported: False if its detector reports it.
    """

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


_NOTHING, _WARN = (0, Action.NONE), (0, Action.WARN)
_HOLD, _RETURN, _LAND = (1, Action.HOLD), (2, Action.RETURN), (3, Action.LAND)
_DESCEND, _TERMINATE = (4, Action.DESCEND), (5, Action.TERMINATE)
_CLIMBING = (_HOLD, _RETURN, _LAND, _TERMINATE)
"""Numbers of NAV_DLL_ACT and NAV_RCL_ACT; DESCEND is in the gap."""
FLIGHT_TERMINATION_OFF = 121212
_FULL_AGAIN = "never in flight"


def _battery(condition: Condition, holds: str, limits: tuple[str, ...], actions: tuple[Action, ...]) -> FailsafeRow:
    choices = tuple(enumerate(actions))
    return FailsafeRow(
        *(condition, holds, limits, "BAT_LOW_T", "COM_LOW_BAT_ACT", choices, 0, _FULL_AGAIN), grounded=True, kept=True
    )


def _sensor(condition: Condition, holds: str, parameter: str, default: Action) -> FailsafeRow:
    choices = (_WARN, _LAND, _DESCEND, _TERMINATE)
    number = next(number for number, action in choices if action is default)
    again = "measurements are accepted again"
    return FailsafeRow(
        *(condition, f"sensors: {holds}", (), "COM_SENS_LOSS_T", parameter, choices, number, again), grounded=True
    )


TABLE: tuple[FailsafeRow, ...] = (
    FailsafeRow(
        Condition.ATTITUDE_LOST,
        "sensors: standard deviation of roll or pitch above 10°; state: position and attitude frozen, although rates "
        "or velocity are not zero",
        *((), "COM_ATT_LOSS_T", "COM_ATT_LOSS_ACT", (_WARN, _TERMINATE), 5),
        "attitude is valid again",
    ),
    FailsafeRow(
        Condition.TILTED,
        "roll or pitch beyond the limit",
        *(("FD_FAIL_R", "FD_FAIL_P"), "FD_FAIL_R_TTRI", "CBRK_FLIGHTTERM"),
        ((0, Action.TERMINATE), (FLIGHT_TERMINATION_OFF, Action.WARN)),
        FLIGHT_TERMINATION_OFF,
        "both within the limit",
    ),
    FailsafeRow(
        Condition.ROTOR_FAILED,
        "the motion indicates a failed rotor; of four: the vehicle lands on three, in any mode; of more: with 2",
        *((), "", "CA_FAILURE_MODE", (_NOTHING, (1, Action.LAND), (2, Action.LAND)), 1),
        _FULL_AGAIN,
        kept=True,
        reported=False,
    ),
    FailsafeRow(
        Condition.POSITION_LOST,
        "sensors, in modes that need position: horizontal standard deviation above the limit",
        *(("COM_POS_FS_EPH", "COM_VEL_FS_EVH"), "COM_POS_FS_DELAY", "COM_POS_FS_ACT"),
        (_WARN, _DESCEND, _TERMINATE),
        4,
        "both within the limits",
    ),
    FailsafeRow(
        Condition.ESTIMATE_INVALID,
        "sensors: heading, height or vertical velocity invalid",
        *((), "COM_EST_LOSS_T", "COM_EST_LOSS_ACT", (_WARN, _LAND, _DESCEND, _TERMINATE), 4),
        "all valid again",
    ),
    _battery(
        Condition.BATTERY_EMERGENCY,
        "charge below the limit, or terminal voltage below a limit other than 0",
        ("BAT_EMERGEN_THR", "BAT_EMERGEN_VOLT"),
        (Action.WARN, Action.LAND, Action.LAND, Action.LAND),
    ),
    _battery(
        Condition.BATTERY_CRITICAL,
        "as above",
        ("BAT_CRIT_THR", "BAT_CRIT_VOLT"),
        (Action.WARN, Action.LAND, Action.LAND, Action.RETURN),
    ),
    FailsafeRow(
        Condition.PLAN_FAILED,
        "the QP is not solved; a fallback flies",
        *((), "COM_QP_LOSS_T", "COM_QP_LOSS_ACT", (_WARN, _HOLD, _RETURN, _LAND), 1),
        "the QP is solved",
    ),
    FailsafeRow(
        Condition.DEADLINE_MISSED,
        "declared solve time (`SIM_SOLVE_MS`) above a control sample",
        *((), "COM_LATE_T", "COM_LATE_ACT", (_WARN, _HOLD, _RETURN, _LAND), 0),
        "it is at most a sample",
    ),
    FailsafeRow(
        Condition.TELEMETRY_MISSED,
        "gap in the plant's frames",
        *((), "COM_TEL_LOSS_T", "COM_TEL_LOSS_ACT", (_WARN, _HOLD, _RETURN, _LAND), 0),
        "frames are consecutive",
    ),
    FailsafeRow(
        Condition.STATION_LOST,
        "HEARTBEATs of ground stations (MAV_TYPE_GCS) stop",
        *((), "COM_DL_LOSS_T", "NAV_DLL_ACT", (_NOTHING, *_CLIMBING), 0),
        "a HEARTBEAT is received",
    ),
    FailsafeRow(
        Condition.FENCE_BREACHED,
        "outside, or within the margin, of the uploaded fence, the circle around home or the height above home; with "
        "GF_PREDICT: at the stopping point",
        *(("GF_MAX_HOR_DIST", "GF_MAX_VER_DIST", "GF_MARGIN", "GF_PREDICT"), "", "GF_ACTION"),
        tuple(enumerate((Action.NONE, Action.WARN, Action.HOLD, Action.RETURN, Action.TERMINATE, Action.LAND))),
        2,
        "inside again",
    ),
    _sensor(
        Condition.GYROSCOPE_LOST,
        "values missing, frozen, impossible or noisy; attitude from magnetometer, GPS and the rotor model",
        "COM_GYR_LOSS_ACT",
        Action.LAND,
    ),
    _sensor(
        Condition.ACCELEROMETER_LOST,
        "the same, or contradicted by GPS velocity and barometer; the thrust model replaces it",
        "COM_ACC_LOSS_ACT",
        Action.LAND,
    ),
    _sensor(
        Condition.BAROMETER_LOST,
        "pressure rejected; height from GPS and accelerometer",
        "COM_BAR_LOSS_ACT",
        Action.WARN,
    ),
    _sensor(Condition.MAGNETOMETER_LOST, "field rejected; heading from the gyroscope", "COM_MAG_LOSS_ACT", Action.WARN),
    FailsafeRow(
        Condition.GPS_LOST,
        "sensors: fixes missing or rejected",
        *((), "COM_GNSSLOSS_T", "COM_GNSSLOSS_ACT", (_WARN, _HOLD, _LAND, _DESCEND, _TERMINATE), 0),
        "fixes are accepted again",
        grounded=True,
        warns="position by dead reckoning",
    ),
    FailsafeRow(
        Condition.STICKS_LOST,
        "in manual modes: MANUAL_CONTROL of the active pilot stops",
        *((), "COM_RC_LOSS_T", "NAV_RCL_ACT", _CLIMBING, 1),
        "sticks are received",
    ),
    FailsafeRow(
        Condition.SETPOINTS_LOST,
        "in mode offboard: the companion's setpoints stop",
        *((), "COM_OF_LOSS_T", "COM_OBL_RC_ACT"),
        ((3, Action.RETURN), (4, Action.LAND), (5, Action.HOLD), (6, Action.TERMINATE)),
        5,
        "setpoints are received",
    ),
    _battery(
        Condition.BATTERY_LOW,
        "charge or voltage below the limit",
        ("BAT_LOW_THR", "BAT_LOW_VOLT"),
        (Action.WARN, Action.RETURN, Action.WARN, Action.WARN),
    ),
)
ROWS: Mapping[Condition, FailsafeRow] = {row.condition: row for row in TABLE}
