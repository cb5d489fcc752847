"""A vehicle and the air around it -> the numbers that the kernel takes."""

from math import inf
from typing import TypedDict

import numpy as np

from colibri.common.types import Array, FourRotors, Vector
from colibri.plant.physics.equations import Parameters
from colibri.plant.vehicle.description import Battery, Drag, Ground, RotorLag, Vehicle


class _Lag(TypedDict):
    lag_up_s: float
    lag_down_s: float


class _Drag(TypedDict):
    linear_drag_n_s_m: Vector
    rotor_drag: float


class _Ground(TypedDict):
    contacts_m: Array
    ground_m: float
    stiffness_n_m: float
    damping_n_s_m: float
    friction: float
    slip_damping_n_s_m: float


class _Battery(TypedDict):
    power: FourRotors
    full_voltage_v: float
    empty_voltage_v: float
    resistance_ohm: float
    capacity_ah: float


def parameters_of(vehicle: Vehicle, wind_enu_m_s: Vector) -> Parameters:
    """Return the numbers of `vehicle` in a wind."""
    thrust, _, _, yaw_moment = vehicle.allocation()
    east, north, up = wind_enu_m_s
    x_m, y_m = np.array(vehicle.rotors.position_m).T
    return Parameters(
        mass_kg=vehicle.body.mass_kg,
        gravity_m_s2=vehicle.gravity_m_s2,
        inertia_kg_m2=vehicle.body.inertia_kg_m2,
        thrust=_four(thrust),
        yaw_moment=_four(yaw_moment),
        momentum=_four(vehicle.rotor_momentum()),
        rotor_x_m=_four(x_m),
        rotor_y_m=_four(y_m),
        top_speed=vehicle.rotors.max_speed,
        wind_enu_m_s=(float(east), float(north), float(up)),
        **_lag(vehicle.rotors.lag),
        **_drag(vehicle.drag),
        **_ground(vehicle.ground, vehicle),
        **_battery(vehicle.battery, vehicle),
    )


def _lag(lag: RotorLag | None) -> _Lag:
    if lag is None:
        return {"lag_up_s": inf, "lag_down_s": inf}
    return {"lag_up_s": lag.time_constant_up_s, "lag_down_s": lag.time_constant_down_s}


def _drag(drag: Drag | None) -> _Drag:
    if drag is None:
        return {"linear_drag_n_s_m": (0.0, 0.0, 0.0), "rotor_drag": 0.0}
    return {"linear_drag_n_s_m": drag.linear_n_s_m, "rotor_drag": drag.rotor_coefficient}


def _ground(ground: Ground | None, vehicle: Vehicle) -> _Ground:
    if ground is None:
        return {
            "contacts_m": np.zeros((8, 3)),
            "ground_m": -inf,
            "stiffness_n_m": 0.0,
            "damping_n_s_m": 0.0,
            "friction": 0.0,
            "slip_damping_n_s_m": 0.0,
        }
    return {
        "contacts_m": ground.contacts_m(vehicle.rotors),
        "ground_m": vehicle.ground_height_m,
        "stiffness_n_m": ground.stiffness_n_m,
        "damping_n_s_m": ground.damping_n_s_m,
        "friction": ground.friction_coefficient,
        "slip_damping_n_s_m": ground.slip_damping_n_s_m,
    }


def _battery(battery: Battery | None, vehicle: Vehicle) -> _Battery:
    """A vehicle without a battery draws nothing from one that always has its full voltage."""
    if battery is None:
        return {
            "power": (0.0, 0.0, 0.0, 0.0),
            "full_voltage_v": 1.0,
            "empty_voltage_v": 1.0,
            "resistance_ohm": 0.0,
            "capacity_ah": inf,
        }
    torque = np.abs(vehicle.allocation()[3])
    return {
        "power": _four(torque * vehicle.rad_s_per_speed_unit / battery.efficiency),
        "full_voltage_v": battery.full_voltage_v,
        "empty_voltage_v": battery.empty_voltage_v,
        "resistance_ohm": battery.resistance_ohm,
        "capacity_ah": battery.capacity_ah,
    }


def _four(values: Array) -> FourRotors:
    a, b, c, d = values.tolist()
    return (a, b, c, d)
