"""ArduCopter's parameters, beside Colibri's own: a change under one name shows under the other.

In `arducopter.csv`, the path is the name of the counterpart; parameters of fence and failsafes have several.
Source: ArduCopter 4.6, Parameters.cpp and its libraries, with the defaults of its SITL.
"""

from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

from colibri.mavlink.mission.items import FENCE, MISSION, RALLY
from colibri.mavlink.parameters.numbers import Number, read_numbers
from colibri.mavlink.parameters.store import Parameter, Parameters, ParamType, Value, float32
from colibri.mavlink.wire.dialect import mav

_WIRE = {"b": mav.MAV_PARAM_TYPE_INT8, "h": mav.MAV_PARAM_TYPE_INT16, "i": mav.MAV_PARAM_TYPE_INT32}
_ALT_MAX, _CIRCLE = 1, 2
_WARN, _HOLD, _RETURN, _LAND = 1, 2, 3, 5
_FENCE_ACTIONS = {0: _WARN, 1: _RETURN, 2: _LAND, 3: _RETURN, 4: _HOLD, 5: _RETURN}
_FENCE_ACTIONS_BACK = {0: 0, _WARN: 0, _HOLD: 4, _RETURN: 1, 4: 1, _LAND: 2}
_FENCE = ("FENCE_ENABLE", "FENCE_TYPE", "FENCE_ALT_MAX", "FENCE_RADIUS", "FENCE_ACTION")
_DISTANCES = (("GF_MAX_VER_DIST", "FENCE_ALT_MAX", _ALT_MAX), ("GF_MAX_HOR_DIST", "FENCE_RADIUS", _CIRCLE))
_OUR_FENCE = ("GF_MAX_VER_DIST", "GF_MAX_HOR_DIST", "GF_ACTION")
_LINK_ACTIONS = {0: 0, 1: 2, 2: 2, 3: 2, 4: 2, 5: 3, 6: 2, 7: 1}
"""NAV_DLL_ACT and NAV_RCL_ACT by FS_GCS_ENABLE and FS_THR_ENABLE, whose 3 is LAND."""
_TOTALS = {MISSION: ("MIS_TOTAL", 1), FENCE: ("FENCE_TOTAL", 0), RALLY: ("RALLY_TOTAL", 0)}
_MAX_TOTALS = {MISSION: 32_767, FENCE: 127, RALLY: 127}
_LINK_ACTIONS_BACK = {0: 0, 1: 7, 2: 1, 3: 5, 5: 5}
_OURS_FROM_THE_START: Mapping[str, Value] = {"MPC_XY_VEL_MAX": 25.0, "COM_DISARM_LAND": 1.0, "COM_GNSSLOSS_T": 10.0} | {
    name: 0.0 for name in ("RTL_MIN_DIST", "BAT_LOW_THR", "BAT_CRIT_THR", "BAT_EMERGEN_THR")
}
"""WPNAV_SPEED limits speeds, a landing disarms at once, every return climbs, batteries are judged by voltage; the
estimator flies without GPS for 10 s."""


@cache
def rows() -> tuple[Number, ...]:
    return read_numbers(Path(__file__).with_name("arducopter.csv"))


def copter_parameters(ours: Iterable[Parameter], system_id: int) -> Parameters:
    """Return both kinds of parameters, with ArduCopter's defaults."""
    own = {"SYSID_THISMAV": system_id}
    theirs = [
        row.parameter(own.get(row.name, row.default), "ArduCopter", wire=_WIRE.get(row.kind, 0)) for row in rows()
    ]
    defaults = {each.name: each.default for each in theirs}
    links = ParameterLinks({each.name: each for each in (*ours, *theirs)})
    return Parameters(
        links.definitions.values(), links=links, initial={**_OURS_FROM_THE_START, **links(defaults, defaults)}
    )


def booted(values: dict[str, Value]) -> dict[str, Value]:
    """Return saved values with one start more."""
    starts = values.get("STAT_BOOTCNT", 0) if values.get("STAT_RESET", 1) else 0
    totals = {name: 0 for name, _ in _TOTALS.values()}
    return {**values, **totals, "STAT_BOOTCNT": int(starts) % 32_767 + 1, "STAT_RESET": 1}


def count_items(parameters: Parameters, plan_type: int, items: int) -> None:
    """Report the size of a plan, with home."""
    name, homes = _TOTALS[plan_type]
    parameters.set(name, min(items + homes, _MAX_TOTALS[plan_type]) if items else 0)


class ParameterLinks:
    def __init__(self, definitions: Mapping[str, Parameter]) -> None:
        self.definitions = definitions
        linked = [(row.name, str(row.path[0]), row.scale) for row in rows() if row.path]
        self._ours = {name: (ours, scale) for name, ours, scale in linked}
        self._theirs = {ours: (name, 1.0 / scale) for name, ours, scale in linked}

    def __call__(self, changes: Mapping[str, Value], values: Mapping[str, Value]) -> dict[str, Value]:
        """Return further changes, given all values with the first ones."""
        found: dict[str, Value] = {}
        for name, value in changes.items():
            other, scale = self._ours.get(name) or self._theirs.get(name) or ("", 0.0)
            if other:
                found[other] = value * scale
        if any(name in changes for name in _FENCE):
            found |= _to_our_fence(values)
        elif any(name in changes for name in _OUR_FENCE):
            found |= _from_our_fence(changes, values)
        if "FS_GCS_ENABLE" in changes:
            found["NAV_DLL_ACT"] = _LINK_ACTIONS.get(int(changes["FS_GCS_ENABLE"]), 2)
        elif "NAV_DLL_ACT" in changes:
            found["FS_GCS_ENABLE"] = _LINK_ACTIONS_BACK.get(int(changes["NAV_DLL_ACT"]), 1)
        if "FS_EKF_ACTION" in changes:
            found["COM_GNSSLOSS_ACT"] = 3 if changes["FS_EKF_ACTION"] else 0
        if "FS_THR_ENABLE" in changes:
            wanted = int(changes["FS_THR_ENABLE"])
            found["NAV_RCL_ACT"] = 3 if wanted == 3 else max(_LINK_ACTIONS.get(wanted, 2), 1)
        elif "NAV_RCL_ACT" in changes:
            back = _LINK_ACTIONS_BACK.get(int(changes["NAV_RCL_ACT"]), 1)
            found["FS_THR_ENABLE"] = 3 if back == 5 else back
        for gps, other in (("SIM_GPS1_ENABLE", "SIM_GPS_DISABLE"), ("SIM_GPS_DISABLE", "SIM_GPS1_ENABLE")):
            if gps in changes:
                found[other] = 1 - int(changes[gps])
        return {name: self._fitted(name, value) for name, value in found.items() if name not in changes}

    def _fitted(self, name: str, value: Value) -> Value:
        definition = self.definitions[name]
        within = min(max(value, definition.minimum), definition.maximum)
        return float32(within) if definition.kind == ParamType.REAL else round(within)


def _to_our_fence(values: Mapping[str, Value]) -> dict[str, Value]:
    kinds = int(values["FENCE_TYPE"]) if values["FENCE_ENABLE"] else 0
    return {
        "GF_MAX_VER_DIST": values["FENCE_ALT_MAX"] if kinds & _ALT_MAX else 0.0,
        "GF_MAX_HOR_DIST": values["FENCE_RADIUS"] if kinds & _CIRCLE else 0.0,
        "GF_ACTION": _FENCE_ACTIONS[int(values["FENCE_ACTION"])],
    }


def _from_our_fence(changes: Mapping[str, Value], values: Mapping[str, Value]) -> dict[str, Value]:
    found: dict[str, Value] = {}
    kinds = int(values["FENCE_TYPE"])
    for name, other, bit in _DISTANCES:
        if name not in changes:
            continue
        if changes[name] > 0.0:
            found |= {other: changes[name], "FENCE_ENABLE": 1}
        kinds = kinds | bit if changes[name] > 0.0 else kinds & ~bit
        found["FENCE_TYPE"] = kinds
    if "GF_ACTION" in changes:
        found["FENCE_ACTION"] = _FENCE_ACTIONS_BACK[int(changes["GF_ACTION"])]
    return found
