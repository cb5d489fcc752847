"""Numbers of control laws that follow from the vehicle.

A profile holds bases and ratios, in the table `scaling` of the law; a number that it gives under its own key wins. The
ratios give the numbers to which the laws were tuned on the Hummingbird. In the formulas:

    thrust  largest thrust, in parts of the weight, with a full battery under load
    climb   g (thrust / 1.1 - 1): acceleration upwards that is left with a tenth more mass; at least a quarter of that
            without it, g (thrust - 1) / 4
    across  g √((thrust / 1.1)² - 1): the same sideways, at a constant height
    turn    angular acceleration in hover, about x, y, z, rad/s²
    slow    the slower of the rotors' lags in parts of `lag_s`, at least 1
    lift    moment of one rotor's lift in hover, N m
"""

from collections.abc import Callable, Mapping
from math import floor, sqrt
from typing import Any, NamedTuple

import numpy as np

from colibri.common.config import Negative, Positive, SettingsError, Table, read_settings
from colibri.common.elementary import square
from colibri.plant.vehicle.description import Vehicle

_LEAST_THRUST = 1.05
_PAYLOAD = 1.1
_LEAST_CLIMB = 0.25
_ACROSS = 0.8


class LpvMpcScaling(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Bases and ratios of `lpv-mpc`."""

    lag_s: Positive
    """Rotor lag above which poles and observers are slower, s."""
    poles: tuple[Negative, Negative]
    acceleration: Positive
    max_g: Positive
    braking_m: Positive
    """Stopping distance of an approach."""
    wind: Positive
    """Largest disturbing acceleration, in parts of gravity."""
    acceleration_rad_s: Positive
    moment_rad_s: Positive
    lost_lift: Positive
    """Largest disturbing moment, in parts of the moment of one rotor's thrust in hover."""
    turn_rad: tuple[Positive, Positive, Positive]
    """Stopping angle of a turn about each axis."""
    max_rate_rad_s: tuple[Positive, Positive, Positive]
    position: Positive
    rate: Positive
    fallback_poles: tuple[Negative, Negative]
    turn_1_s: Positive
    rate_1_s: Positive


class GeometricScaling(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Bases of `geometric-se3`."""

    lag_s: Positive
    position_rad_s: Positive
    attitude_rad_s: Positive
    yaw_rad_s: Positive


class Capability(NamedTuple):
    """What a vehicle can do; see above."""

    thrust: float
    climb_m_s2: float
    across_m_s2: float
    turn_rad_s2: tuple[float, float, float]
    lag_s: float
    lift_n_m: float
    gravity_m_s2: float


class ScalingRule(NamedTuple):
    """A number of a law."""

    formula: str
    value: Callable[[Capability, Any], Any]


def capability_of(vehicle: Vehicle) -> Capability:
    rotors, gravity = vehicle.rotors, vehicle.gravity_m_s2
    weight_n, allocation = vehicle.body.mass_kg * gravity, vehicle.allocation() * square(rotors.max_speed)
    hover, most = weight_n / float(allocation[0].sum()), square(sagging_speed(vehicle))
    turns = np.abs(allocation[1:]).sum(axis=1) * max(min(hover, most - hover), 0.0) / vehicle.body.inertia_kg_m2
    lag_s = max(rotors.lag.time_constant_up_s, rotors.lag.time_constant_down_s) if rotors.lag else 0.0
    lever_m = float(np.abs(np.array(rotors.position_m)).max())
    x, y, z = turns.tolist()
    thrust, lift_n_m = most / hover, weight_n / len(rotors.position_m) * lever_m
    climb_m_s2 = gravity * max(thrust / _PAYLOAD - 1.0, _LEAST_CLIMB * (thrust - 1.0))
    across_m_s2 = gravity * sqrt(max(square(thrust / _PAYLOAD) - 1.0, 0.0))
    return Capability(thrust, climb_m_s2, across_m_s2, (x, y, z), lag_s, lift_n_m, gravity)


def sagging_speed(vehicle: Vehicle) -> float:
    """Return the speed of all rotors at full throttle, in parts of the largest: s² + (V / R P)(V s - V) = 0."""
    battery, rotors = vehicle.battery, vehicle.rotors
    if battery is None or battery.resistance_ohm == 0.0:
        return 1.0
    torque = len(rotors.position_m) * rotors.torque_coefficient * square(rotors.max_speed)
    power_w = torque * vehicle.rad_s_per_speed_unit * rotors.max_speed / battery.efficiency
    stiff = square(battery.full_voltage_v) / (battery.resistance_ohm * power_w)
    return 0.5 * (sqrt(stiff * stiff + 4.0 * stiff) - stiff)


def _slow(vehicle: Capability, ratios: Any) -> float:
    return float(max(vehicle.lag_s / ratios.lag_s, 1.0))


def _slowed(name: str, power: float) -> Callable[[Capability, Any], Any]:
    def value(vehicle: Capability, ratios: Any) -> Any:
        base, factor = getattr(ratios, name), _slow(vehicle, ratios) ** power
        return [factor * each for each in base] if isinstance(base, tuple) else factor * base

    return value


def _led_lag(vehicle: Capability, ratios: GeometricScaling) -> float:
    return 0.5 * _slowed("lag_s", 0.75)(vehicle, ratios) if vehicle.lag_s > ratios.lag_s else 0.0


def _most(vehicle: Capability, ratios: LpvMpcScaling) -> float:
    return float(ratios.max_g * vehicle.gravity_m_s2 / sqrt(_slow(vehicle, ratios)))


def _climb(vehicle: Capability, ratios: LpvMpcScaling) -> float:
    return min(ratios.acceleration * vehicle.climb_m_s2, _most(vehicle, ratios))


def _acceleration(vehicle: Capability, ratios: LpvMpcScaling) -> float:
    return max(_climb(vehicle, ratios), min(_ACROSS * vehicle.across_m_s2, _most(vehicle, ratios)))


def _approach_speed(vehicle: Capability, ratios: LpvMpcScaling) -> float:
    return sqrt(2.0 * ratios.braking_m * _climb(vehicle, ratios))


def _max_rate(vehicle: Capability, ratios: LpvMpcScaling) -> list[float]:
    turns = zip(ratios.turn_rad, vehicle.turn_rad_s2, ratios.max_rate_rad_s, strict=True)
    return [min(sqrt(2.0 * within * turn), most) for within, turn, most in turns]


_LPV_MPC = {
    "guidance.poles": ScalingRule("poles / √slow", _slowed("poles", -0.5)),
    "guidance.max_climb_m_s2": ScalingRule("acceleration × climb, at most max_g × g / √slow", _climb),
    "guidance.max_acceleration_m_s2": ScalingRule(
        "at least max_climb_m_s2 and 0.8 across, at most max_g × g / √slow", _acceleration
    ),
    "guidance.approach_speed_m_s": ScalingRule("√(2 braking_m × max_climb_m_s2)", _approach_speed),
    "observer.acceleration_rad_s": ScalingRule("acceleration_rad_s / √slow", _slowed("acceleration_rad_s", -0.5)),
    "observer.moment_rad_s": ScalingRule("moment_rad_s / slow", _slowed("moment_rad_s", -1.0)),
    "observer.max_acceleration_m_s2": ScalingRule(
        "wind × g", lambda vehicle, ratios: ratios.wind * vehicle.gravity_m_s2
    ),
    "observer.max_moment_n_m": ScalingRule(
        "lost_lift × lift", lambda vehicle, ratios: ratios.lost_lift * vehicle.lift_n_m
    ),
    "plan.max_rate_rad_s": ScalingRule("√(2 turn_rad × turn), at most max_rate_rad_s", _max_rate),
    "weights.position": ScalingRule("position / √slow", _slowed("position", -0.5)),
    "weights.rate": ScalingRule("rate × slow³", _slowed("rate", 3.0)),
    "fallback.poles": ScalingRule("fallback_poles / √slow", _slowed("fallback_poles", -0.5)),
    "fallback.turn_1_s": ScalingRule("turn_1_s / slow", _slowed("turn_1_s", -1.0)),
    "fallback.rate_1_s": ScalingRule("rate_1_s / slow", _slowed("rate_1_s", -1.0)),
}
_GEOMETRIC = {
    "position_frequency_rad_s": ScalingRule("position_rad_s / slow^¾", _slowed("position_rad_s", -0.75)),
    "attitude_frequency_rad_s": ScalingRule("attitude_rad_s / slow^¾", _slowed("attitude_rad_s", -0.75)),
    "yaw_frequency_rad_s": ScalingRule("yaw_rad_s / slow", _slowed("yaw_rad_s", -1.0)),
    "rotor_lag_s": ScalingRule("lag_s × slow^¾ / 2, if slow > 1", _led_lag),
}
LAWS: dict[str, tuple[type[Table], dict[str, ScalingRule]]] = {
    "lpv-mpc": (LpvMpcScaling, _LPV_MPC),
    "geometric-se3": (GeometricScaling, _GEOMETRIC),
}


def formulas(law: str) -> dict[str, str]:
    """Return the formulas of a law's numbers, by their keys."""
    return {key: row.formula for key, row in LAWS[law][1].items()} if law in LAWS else {}


def scaled(law: str, table: Mapping[str, Any], vehicle: Vehicle) -> dict[str, Any]:
    """Return the settings of a law, without `scaling`, with the numbers that follow from the vehicle.

    A SettingsError is raised for a vehicle too heavy for its rotors, and for missing, unknown or invalid ratios.
    """
    given = {key: value for key, value in table.items() if key != "scaling"}
    if law not in LAWS or "scaling" not in table:
        return given
    kind, rows = LAWS[law]
    ratios, can = read_settings(table["scaling"], kind), capability_of(vehicle)
    if can.thrust < _LEAST_THRUST:
        raise SettingsError(
            f'vehicle "{vehicle.name}": the largest thrust is {floor(100.0 * can.thrust) / 100.0:g} times the weight: '
            f"at least {_LEAST_THRUST} is required"
        )
    for key, row in rows.items():
        room, _, name = key.rpartition(".")
        if not room:
            given.setdefault(name, _rounded(row.value(can, ratios)))
        elif isinstance(given.get(room), Mapping):
            given[room] = {name: _rounded(row.value(can, ratios)), **given[room]}
    return given


def _rounded(value: Any) -> Any:
    return [_rounded(each) for each in value] if isinstance(value, list) else float(f"{value:.3g}")
