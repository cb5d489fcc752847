"""Convert a vehicle and the wind to the kernel's parameters."""

import numpy as np

from colibri.common.types import Array, FourRotors, Vector
from colibri.plant.physics.equations import PlantParameters
from colibri.plant.vehicle.description import Vehicle


def parameters_of(vehicle: Vehicle, wind_enu_m_s: Vector) -> PlantParameters:
    thrust, _, _, yaw_moment = vehicle.allocation()
    east, north, up = wind_enu_m_s
    x_m, y_m = np.array(vehicle.rotors.position_m).T
    numbers = PlantParameters(
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
    )
    if (lag := vehicle.rotors.lag) is not None:
        numbers = numbers._replace(lag_up_s=lag.time_constant_up_s, lag_down_s=lag.time_constant_down_s)
    if (drag := vehicle.drag) is not None:
        numbers = numbers._replace(
            linear_drag_n_s_m=drag.linear_n_s_m,
            quadratic_drag_n_s2_m2=drag.quadratic_n_s2_m2,
            rotor_drag=drag.rotor_coefficient,
        )
    if (ground := vehicle.ground) is not None:
        numbers = numbers._replace(
            contacts_m=ground.contacts_m(vehicle.rotors),
            ground_m=vehicle.ground_height_m,
            stiffness_n_m=ground.stiffness_n_m,
            damping_n_s_m=ground.damping_n_s_m,
            friction=ground.friction_coefficient,
            slip_damping_n_s_m=ground.slip_damping_n_s_m,
        )
    if (battery := vehicle.battery) is not None:
        torque = np.abs(vehicle.allocation()[3])
        numbers = numbers._replace(
            power=_four(torque * vehicle.rad_s_per_speed_unit / battery.efficiency),
            full_voltage_v=battery.full_voltage_v,
            empty_voltage_v=battery.empty_voltage_v,
            resistance_ohm=battery.resistance_ohm,
            capacity_ah=battery.capacity_ah,
        )
    return numbers


def _four(values: Array) -> FourRotors:
    a, b, c, d = values.tolist()
    return (a, b, c, d)
