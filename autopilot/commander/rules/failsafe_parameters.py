"""Parameters of the failsafes, under PX4's names where the meaning is the same."""

from collections.abc import Mapping
from typing import NamedTuple, TypeAlias

from colibri.autopilot.commander.rules.failsafe_rule import FailsafeSetting
from colibri.autopilot.commander.rules.failsafe_table import NAMES, TABLE, Action, Condition
from colibri.mavlink.parameters.store import Parameter, Parameters, ParamType

Limits: TypeAlias = Mapping[str, float]
"""Parameter name -> value, in the parameter's unit."""

GROUP = "Failsafes"
_US = 1e6


class FailsafeNumber(NamedTuple):
    """A limit or delay, with the fields of its parameter; an int `default` makes a switch."""

    name: str
    default: float
    minimum: float
    maximum: float
    unit: str
    description: str
    details: str = ""

    def parameter(self) -> Parameter:
        switch = isinstance(self.default, int)
        return Parameter(
            name=self.name,
            kind=ParamType.INT if switch else ParamType.REAL,
            default=self.default,
            minimum=self.minimum,
            maximum=self.maximum,
            unit=self.unit,
            decimals=2,
            description=self.description,
            details=self.details,
            group=GROUP,
            values=((0, "Disabled"), (1, "Enabled")) if switch else (),
        )


NUMBERS = (
    FailsafeNumber("COM_ATT_LOSS_T", 0.5, 0.0, 60.0, "s", "Attitude loss delay"),
    FailsafeNumber("FD_FAIL_R", 80.0, 30.0, 180.0, "deg", "Largest roll", "Beyond: tilted too far."),
    FailsafeNumber("FD_FAIL_P", 80.0, 30.0, 180.0, "deg", "Largest pitch", "Beyond: tilted too far."),
    FailsafeNumber("FD_FAIL_R_TTRI", 0.3, 0.02, 5.0, "s", "Tilt delay", "Roll and pitch."),
    FailsafeNumber("COM_POS_FS_EPH", 5.0, 0.1, 400.0, "m", "Position loss limit", "Horizontal standard deviation."),
    FailsafeNumber("COM_VEL_FS_EVH", 1.0, 0.1, 30.0, "m/s", "Velocity loss limit", "Horizontal standard deviation."),
    FailsafeNumber("COM_POS_FS_DELAY", 1.0, 0.0, 100.0, "s", "Position loss delay"),
    FailsafeNumber("COM_EST_LOSS_T", 1.0, 0.0, 60.0, "s", "Estimate loss delay"),
    FailsafeNumber("BAT_LOW_THR", 0.15, 0.0, 1.0, "norm", "Low battery", "Fraction of full charge."),
    FailsafeNumber("BAT_CRIT_THR", 0.07, 0.0, 1.0, "norm", "Critical battery", "Fraction of full charge."),
    FailsafeNumber("BAT_EMERGEN_THR", 0.05, 0.0, 1.0, "norm", "Nearly empty battery", "Fraction of full charge."),
    FailsafeNumber("BAT_LOW_VOLT", 0.0, 0.0, 100.0, "V", "Low battery voltage", "At the terminals; 0: off."),
    FailsafeNumber("BAT_CRIT_VOLT", 0.0, 0.0, 100.0, "V", "Critical battery voltage", "At the terminals; 0: off."),
    FailsafeNumber("BAT_EMERGEN_VOLT", 0.0, 0.0, 100.0, "V", "Nearly empty voltage", "At the terminals; 0: off."),
    FailsafeNumber("BAT_LOW_T", 1.0, 0.0, 120.0, "s", "Battery delay", "Covers voltage sag in climbs."),
    FailsafeNumber("COM_QP_LOSS_T", 0.5, 0.0, 60.0, "s", "Plan loss delay"),
    FailsafeNumber("COM_LATE_T", 1.0, 0.0, 60.0, "s", "Deadline delay"),
    FailsafeNumber(
        "COM_TEL_LOSS_T", 0.5, 0.0, 60.0, "s", "Telemetry loss timeout", "Longest gap in the plant's frames."
    ),
    FailsafeNumber(
        "COM_DL_LOSS_T", 10.0, 0.5, 300.0, "s", "Ground station loss timeout", "Longest silence of all stations."
    ),
    FailsafeNumber("GF_MARGIN", 0.0, 0.0, 1000.0, "m", "Fence margin", "Closer to the edge is a breach."),
    FailsafeNumber("GF_PREDICT", 0, 0, 1, "", "Fence prediction", "Act if the stopping point is beyond the margin."),
    FailsafeNumber("COM_SENS_LOSS_T", 0.5, 0.0, 60.0, "s", "Sensor loss delay", "All sensors but GPS."),
    FailsafeNumber("COM_GNSSLOSS_T", 1.0, 1.0, 300.0, "s", "GPS loss timeout"),
)

ELSEWHERE = ("COM_OF_LOSS_T", "COM_RC_LOSS_T")
"""Delays defined with the behaviour, because modes use them."""

_ACTIONS: Mapping[str, str] = {
    "COM_ATT_LOSS_ACT": "Attitude loss action",
    "CBRK_FLIGHTTERM": "Tilt action",
    "COM_POS_FS_ACT": "Position loss action",
    "COM_EST_LOSS_ACT": "Estimate loss action",
    "COM_LOW_BAT_ACT": "Battery action",
    "COM_QP_LOSS_ACT": "Plan loss action",
    "COM_LATE_ACT": "Deadline action",
    "COM_TEL_LOSS_ACT": "Telemetry loss action",
    "NAV_DLL_ACT": "Ground station loss action",
    "GF_ACTION": "Fence action",
    "COM_GYR_LOSS_ACT": "Gyroscope loss action",
    "COM_ACC_LOSS_ACT": "Accelerometer loss action",
    "COM_BAR_LOSS_ACT": "Barometer loss action",
    "COM_MAG_LOSS_ACT": "Magnetometer loss action",
    "COM_GNSSLOSS_ACT": "GPS loss action",
    "NAV_RCL_ACT": "Stick loss action",
    "COM_OBL_RC_ACT": "Offboard loss action",
}
_BATTERY_ACTIONS = (
    (0, "Warning"),
    (1, "Return when low, land when critical"),
    (2, "Land when critical"),
    (3, "Return when critical, land when nearly empty"),
)


_COPTER_ACTIONS = {Condition.BATTERY_LOW: "BATT_FS_LOW_ACT", Condition.BATTERY_CRITICAL: "BATT_FS_CRT_ACT"}
_COPTER_BATTERY = {
    0: Action.WARN,
    1: Action.LAND,
    2: Action.RETURN,
    3: Action.RETURN,
    4: Action.LAND,
    5: Action.TERMINATE,
    6: Action.RETURN,
    7: Action.HOLD,
}
"""Actions by ArduCopter's parameters, where they are defined."""


def failsafe_parameters() -> list[Parameter]:
    return [*(number.parameter() for number in NUMBERS), *_actions()]


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


def _actions() -> list[Parameter]:
    rows = {row.parameter: row for row in TABLE}
    return [
        Parameter(
            name=name,
            kind=ParamType.INT,
            default=row.default,
            minimum=min(number for number, _ in row.choices),
            maximum=max(number for number, _ in row.choices),
            description=_ACTIONS[name],
            group=GROUP,
            values=_BATTERY_ACTIONS if name == "COM_LOW_BAT_ACT" else _named(row.choices),
        )
        for name, row in rows.items()
        if name in _ACTIONS
    ]


def _named(choices: tuple[tuple[int, Action], ...]) -> tuple[tuple[int, str], ...]:
    return tuple((number, NAMES[action].capitalize()) for number, action in choices)
