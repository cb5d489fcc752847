"""Parameters of the behaviour, under PX4's names where the meaning is the same."""

from collections.abc import Callable, Mapping
from dataclasses import fields
from math import inf, radians
from typing import Any, NamedTuple

from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.guidance.integrator_chain import Limits
from colibri.autopilot.guidance.trajectories.tracks import THESIS_TRACKS
from colibri.mavlink.parameters.store import Parameter, Parameters, ParamType, Value

TRACKS = (*THESIS_TRACKS, "lemniscate", "circle")
"""Tracks by the number of TRACK."""
_BEHAVIOUR = Behaviour()
_DEG = radians(1.0)
_YES_OR_NO = ((0, "Disabled"), (1, "Enabled"))


class Tunable(NamedTuple):
    """A parameter for a `field`, which is `scale` times the parameter."""

    name: str
    field: str
    unit: str
    minimum: float
    maximum: float
    description: str
    details: str = ""
    scale: float = 1.0
    decimals: int = 2
    values: tuple[tuple[int, str], ...] = ()

    def parameter(self) -> Parameter:
        value = _field(self.field)
        kind = ParamType.REAL if isinstance(value, float) else ParamType.INT
        return Parameter(
            name=self.name,
            kind=kind,
            default=value / self.scale if isinstance(value, float) else _number(value),
            minimum=self.minimum,
            maximum=self.maximum,
            unit=self.unit,
            decimals=self.decimals,
            description=self.description,
            details=self.details,
            group=_group(self.name),
            values=self.values,
        )


ROWS = (
    Tunable("MIS_TAKEOFF_ALT", "takeoff_height_m", "m", 0.5, 1000.0, "Take-off height", "Above the ground."),
    Tunable("MPC_XY_CRUISE", "speed_m_s", "m/s", 0.1, 25.0, "Horizontal speed", "In automatic modes."),
    Tunable("MPC_XY_VEL_MAX", "max_speed_m_s", "m/s", 0.1, 25.0, "Maximum horizontal speed", "Limit of all commands."),
    Tunable("MPC_Z_VEL_MAX_UP", "climb_m_s", "m/s", 0.1, 10.0, "Climb speed"),
    Tunable("MPC_Z_VEL_MAX_DN", "sink_m_s", "m/s", 0.1, 6.0, "Descent speed"),
    Tunable("MPC_ACC_HOR", "acceleration_m_s2", "m/s^2", 0.5, 12.0, "Horizontal acceleration"),
    Tunable("MPC_ACC_UP_MAX", "lift_m_s2", "m/s^2", 0.5, 8.0, "Vertical acceleration", "Up and down."),
    Tunable("MPC_JERK_MAX", "jerk_m_s3", "m/s^3", 1.0, 100.0, "Jerk", "Lower is smoother."),
    Tunable("MPC_YAWRAUTO_MAX", "yaw_rate_rad_s", "deg/s", 5.0, 360.0, "Yaw rate", "", _DEG, 1),
    Tunable("MPC_YAWRAUTO_ACC", "yaw_acceleration_rad_s2", "deg/s^2", 10.0, 720.0, "Yaw acceleration", "", _DEG, 1),
    Tunable("MPC_TKO_SPEED", "takeoff_speed_m_s", "m/s", 0.2, 5.0, "Take-off speed"),
    Tunable("MPC_LAND_SPEED", "land_speed_m_s", "m/s", 0.2, 2.0, "Landing speed", "Near the ground."),
    Tunable("MPC_MAN_TILT_MAX", "max_tilt_deg", "deg", 1.0, 60.0, "Tilt at full stick", "Mode stabilized.", 1.0, 1),
    Tunable("MPC_MAN_Y_MAX", "stick_yaw_rate_rad_s", "deg/s", 1.0, 400.0, "Yaw rate at full stick", "", _DEG, 1),
    Tunable("MPC_VEL_MANUAL", "stick_speed_m_s", "m/s", 0.1, 20.0, "Horizontal speed at full stick", "Mode position."),
    Tunable("RTL_RETURN_ALT", "return_height_m", "m", 0.0, 1000.0, "Return height", "Above home."),
    Tunable(
        *("RTL_MIN_DIST", "return_radius_m", "m", 0.0, 1000.0, "Return radius without climb"),
        "Closer to home, the return skips its climb.",
    ),
    Tunable("NAV_ACC_RAD", "acceptance_m", "m", 0.05, 200.0, "Acceptance radius", "Distance that counts as arrival."),
    Tunable("COM_DISARM_LAND", "disarm_after_landing_s", "s", 0.0, 300.0, "Disarm delay after landing", "0: off."),
    Tunable("COM_DISARM_PRFLT", "disarm_on_ground_s", "s", 0.0, 3600.0, "Disarm delay without take-off", "0: off."),
    Tunable(
        *("COM_OF_LOSS_T", "setpoints_lost_s", "s", 0.1, 60.0, "Offboard loss timeout"),
        "Longest silence of a companion; its last body rates are followed for 0.3 s.",
    ),
    Tunable("COM_RC_LOSS_T", "sticks_lost_s", "s", 0.1, 35.0, "Stick loss timeout", "Longest silence of the sticks."),
    Tunable("GF_MAX_HOR_DIST", "max_distance_m", "m", 0.0, 100e3, "Fence around home", "Horizontal distance; 0: off."),
    Tunable("GF_MAX_VER_DIST", "max_height_m", "m", 0.0, 10e3, "Fence above home", "Height; 0: off."),
    Tunable("ORBIT_RADIUS", "orbit_radius_m", "m", 1.0, 1000.0, "Orbit radius", "Default, if the command has NaN."),
    Tunable("FLW_TGT_HT", "follow_height_m", "m", 1.0, 1000.0, "Follow: height", "Above home."),
    Tunable("FLW_TGT_DST", "follow_distance_m", "m", 1.0, 1000.0, "Follow: distance to the target"),
    Tunable(
        *("FLW_TGT_FA", "follow_angle_deg", "deg", -180.0, 180.0, "Follow: bearing from the target"),
        *("Clockwise; 0 is ahead, 180 behind.", 1.0, 1),
    ),
    Tunable(
        *("FLW_TGT_ALT_M", "follow_altitude_mode", "", 0, 2, "Follow: height reference"),
        values=((0, "Home"), (1, "Ground below"), (2, "Target")),
    ),
    Tunable(
        *("CA_FAILURE_MODE", "rotor_failure", "", 0, 2, "Rotor failure"),
        *("Detection; 0 also clears a detected failure.",),
        values=((0, "Ignore"), (1, "Land on three of four, fly on without one of more"), (2, "Land")),
    ),
    Tunable(
        *("SYS_FAILURE_EN", "inject_failures", "", 0, 1, "Failure injection"),
        *("Accept MAV_CMD_INJECT_FAILURE.",),
        values=_YES_OR_NO,
    ),
    Tunable(
        *("SIM_SOLVE_MS", "solve_time_s", "ms", 0.0, 100.0, "Declared solve time"),
        "Simulated delay of commands; samples in between are skipped.",
        *(1e-3, 1),
    ),
    Tunable(
        *("SYS_CMD_DELAY", "delay_s", "ms", -1.0, 200.0, "Compensated delay"),
        "From a frame to the effect of its command. -1: profile or measured.",
        *(1e-3, 1),
    ),
    Tunable(
        *("TRACK", "track", "", 0, len(TRACKS) - 1, "Track", "Track of mode track."),
        values=tuple(enumerate(TRACKS)),
    ),
)
"""One row for each number of `Behaviour` and `Limits`."""

_POLYGONS, _FLOOR, _FACES_HOME = 4, 8, (1, 3)
BY_IDENTITY: Mapping[str, Callable[[Parameters], Any]] = {
    "return_delay_s": lambda p: 1e-3 * p["RTL_LOIT_TIME"],
    "return_final_m": lambda p: 0.01 * p["RTL_ALT_FINAL"],
    "return_cone": lambda p: p["RTL_CONE_SLOPE"],
    "return_speed_m_s": lambda p: 0.01 * p["RTL_SPEED"],
    "return_climb_m": lambda p: 0.01 * p["RTL_CLIMB_MIN"],
    "return_faces": lambda p: p["WP_YAW_BEHAVIOR"] in _FACES_HOME,
    "land_high_m_s": lambda p: 0.01 * p["LAND_SPEED_HIGH"],
    "land_slow_below_m": lambda p: 0.01 * p["LAND_ALT_LOW"],
    "stick_climb_m_s": lambda p: 0.01 * p["PILOT_SPEED_UP"],
    "stick_sink_m_s": lambda p: 0.01 * (p["PILOT_SPEED_DN"] or p["PILOT_SPEED_UP"]),
    "uploaded_fence": lambda p: bool(p["FENCE_ENABLE"] and int(p["FENCE_TYPE"]) & _POLYGONS),
    "floor_m": lambda p: p["FENCE_ALT_MIN"] if p["FENCE_ENABLE"] and int(p["FENCE_TYPE"]) & _FLOOR else -inf,
}
"""Fields that only ArduCopter's parameters set, where they are defined."""

_ANSWERS = "Compatibility only, without effect."


def behaviour_parameters(system_id: int) -> list[Parameter]:
    """Return the behaviour's parameters, and those that ground stations expect from PX4."""
    return [*(row.parameter() for row in ROWS), *_answers(system_id)]


def behaviour(parameters: Parameters) -> Behaviour:
    """Return the behaviour by the parameters; unchanged numbers keep 64 bits."""
    changed: dict[str, Any] = {}
    for row in ROWS:
        value = parameters[row.name]
        if value == parameters.default(row.name):
            continue
        if row.field == "track":
            changed[row.field] = TRACKS[int(value)]
        elif isinstance(_field(row.field), bool):
            changed[row.field] = bool(value)
        else:
            changed[row.field] = value * row.scale if isinstance(value, float) else value
    if "RTL_LOIT_TIME" in parameters:
        changed |= {field: value(parameters) for field, value in BY_IDENTITY.items()}
    limits = {field: changed.pop(field) for field in Limits._fields if field in changed}
    whole = {field.name: getattr(_BEHAVIOUR, field.name) for field in fields(Behaviour)}
    return Behaviour(**{**whole, **changed, "limits": _BEHAVIOUR.limits._replace(**limits)})


def _answers(system_id: int) -> list[Parameter]:
    return [
        _answer("SYS_AUTOSTART", 4001, "Airframe", read_only=True),
        _answer("SYS_AUTOCONFIG", 0, "Airframe reset"),
        _answer("CAL_GYRO0_ID", 1, "Calibrated gyroscope", read_only=True),
        _answer("CAL_ACC0_ID", 1, "Calibrated accelerometer", read_only=True),
        _answer("CAL_MAG0_ID", 1, "Calibrated magnetometer", read_only=True),
        _answer("COM_RC_IN_MODE", 1, "Stick source", values=((1, "Joystick"),)),
        # MAVSDK sets these two before it follows; the chain of the reference has limits of its own.
        _answer("FLW_TGT_RS", 0.1, "Follow: filter", minimum=0.0, maximum=1.0, unit="norm"),
        _answer("FLW_TGT_MAX_VEL", 5.0, "Follow: speed", minimum=0.0, maximum=20.0, unit="m/s"),
        _answer(
            *("MAV_SYS_ID", system_id, "System id", "Set by the instance."), minimum=1, maximum=255, read_only=True
        ),
    ]


def _answer(name: str, default: Value, description: str, details: str = _ANSWERS, **others: Any) -> Parameter:
    kind = ParamType.REAL if isinstance(default, float) else ParamType.INT
    fields = {"description": description, "details": details, "group": _group(name), **others}
    return Parameter(name=name, kind=kind, default=default, **fields)


def _field(name: str) -> Any:
    return getattr(_BEHAVIOUR.limits if name in Limits._fields else _BEHAVIOUR, name)


def _number(value: Any) -> int:
    return TRACKS.index(value) if isinstance(value, str) else int(value)


def _group(name: str) -> str:
    return _GROUPS[name.partition("_")[0]]


_PREFIXES = {
    "Flight": "MIS MPC NAV ORBIT TRACK",
    "Follow": "FLW",
    "Return": "RTL",
    "Safety": "COM CA",
    "Failsafes": "GF",
    "System": "SYS SIM CAL MAV",
}
_GROUPS = {prefix: group for group, prefixes in _PREFIXES.items() for prefix in prefixes.split()}
