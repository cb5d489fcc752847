"""Parameters of the behaviour, under PX4's names where the meaning is the same."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from math import inf
from pathlib import Path
from typing import Any

from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.guidance.integrator_chain import Limits
from colibri.mavlink.parameters.numbers import Number, read_numbers
from colibri.mavlink.parameters.store import Parameter, Parameters, Value

_LINES = read_numbers(Path(__file__).with_name("behaviour.csv"))
ROWS = tuple(line for line in _LINES if line.path)
"""Numbers of `Behaviour`; lines without a path are only expected by ground stations of PX4."""
TRACKS = tuple(name for line in ROWS if line.name == "TRACK" for _, name in line.values)
"""Tracks by the number of TRACK."""
_BEHAVIOUR = Behaviour()

_POLYGONS, _FLOOR, _FACES_HOME, _ENDS_LANDED = 4, 8, (1, 3), 4
BY_IDENTITY: Mapping[str, Callable[[Parameters], Any]] = {
    "return_delay_s": lambda p: 1e-3 * p["RTL_LOIT_TIME"],
    "return_final_m": lambda p: 0.01 * p["RTL_ALT_FINAL"],
    "return_cone": lambda p: p["RTL_CONE_SLOPE"],
    "return_speed_m_s": lambda p: 0.01 * p["RTL_SPEED"],
    "return_climb_m": lambda p: 0.01 * p["RTL_CLIMB_MIN"],
    "return_faces": lambda p: p["WP_YAW_BEHAVIOR"] in _FACES_HOME,
    "items_face": lambda p: p["WP_YAW_BEHAVIOR"] != 0,
    "copter_items": lambda _: True,
    "rally_only": lambda p: not p["RALLY_INCL_HOME"],
    "hover_throttle": lambda p: p["MOT_THST_HOVER"],
    "stick_landings_end": lambda p: bool(int(p["PILOT_THR_BHV"]) & _ENDS_LANDED),
    "land_high_m_s": lambda p: 0.01 * p["LAND_SPEED_HIGH"],
    "land_slow_below_m": lambda p: 0.01 * p["LAND_ALT_LOW"],
    "uploaded_fence": lambda p: bool(p["FENCE_ENABLE"] and int(p["FENCE_TYPE"]) & _POLYGONS),
    "floor_m": lambda p: p["FENCE_ALT_MIN"] if p["FENCE_ENABLE"] and int(p["FENCE_TYPE"]) & _FLOOR else -inf,
}
"""Fields that only ArduCopter's parameters set, where they are defined."""


@cache
def behaviour_parameters(system_id: int) -> tuple[Parameter, ...]:
    numbers = {line.name: _default(line) if line.path else line.default for line in _LINES}
    numbers["MAV_SYS_ID"] = system_id
    return tuple(line.parameter(numbers[line.name]) for line in _LINES)


def behaviour(parameters: Parameters) -> Behaviour:
    """Return the behaviour by the parameters; unchanged numbers keep 64 bits."""
    changed: dict[str, Any] = {}
    for row in ROWS:
        value, field = parameters[row.name], str(row.path[-1])
        if value == parameters.default(row.name):
            continue
        if field == "track":
            changed[field] = TRACKS[int(value)]
        elif isinstance(_field(row), bool):
            changed[field] = bool(value)
        else:
            changed[field] = value * row.scale if isinstance(value, float) else value
    found = {field: changed.pop(field) for field in Limits._fields if field in changed}
    limits = changed["limits"] = _BEHAVIOUR.limits._replace(**found)
    if "RTL_LOIT_TIME" in parameters:
        changed |= {field: value(parameters) for field, value in BY_IDENTITY.items()}
        up, down, lift = (0.01 * parameters[f"PILOT_{name}"] for name in ("SPEED_UP", "SPEED_DN", "ACCEL_Z"))
        up = up or limits.climb_m_s
        changed["stick_limits"] = limits._replace(climb_m_s=up, sink_m_s=down or up, lift_m_s2=max(lift, 0.5))
    return replace(_BEHAVIOUR, **changed)


def _default(row: Number) -> Value:
    value = _field(row)
    if isinstance(value, float):
        return value / row.scale
    return TRACKS.index(value) if isinstance(value, str) else int(value)


def _field(row: Number) -> Any:
    found: Any = _BEHAVIOUR
    for field in row.path:
        found = getattr(found, str(field))
    return found
