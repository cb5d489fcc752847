"""Convert a vehicle and the wind to the kernel's parameters."""

import numpy as np

from colibri.common.matrices import inverse
from colibri.common.types import Vector
from colibri.plant.physics.equations import PlantParameters
from colibri.plant.vehicle.description import Vehicle


def parameters_of(vehicle: Vehicle, wind_enu_m_s: Vector) -> PlantParameters:
    rotors, arms_m = vehicle.rotors, vehicle.arms_m()
    strength = np.array(rotors.strength)
    thrust, yaw_moment = rotors.thrust_coefficient * strength, -rotors.spin() * rotors.torque_coefficient * strength
    east, north, up = wind_enu_m_s
    numbers = PlantParameters(
        mass_kg=vehicle.body.mass_kg,
        gravity_m_s2=vehicle.gravity_m_s2,
        inertia_kg_m2=vehicle.body.inertia_kg_m2,
        thrust=tuple(thrust.tolist()),
        yaw_moment=tuple(yaw_moment.tolist()),
        momentum=tuple(vehicle.rotor_momentum().tolist()),
        rotor_x_m=tuple(arms_m[:, 0].tolist()),
        rotor_y_m=tuple(arms_m[:, 1].tolist()),
        power=(0.0,) * rotors.count,
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
            contacts_m=vehicle.contacts_m(),
            ground_m=vehicle.ground_height_m,
            stiffness_n_m=ground.stiffness_n_m,
            damping_n_s_m=ground.damping_n_s_m,
            friction=ground.friction_coefficient,
            slip_damping_n_s_m=ground.slip_damping_n_s_m,
        )
    if (battery := vehicle.battery) is not None:
        power = np.abs(yaw_moment) * vehicle.rad_s_per_speed_unit / battery.efficiency
        numbers = numbers._replace(
            power=tuple(power.tolist()),
            full_voltage_v=battery.full_voltage_v,
            empty_voltage_v=battery.empty_voltage_v,
            resistance_ohm=battery.resistance_ohm,
            capacity_ah=battery.capacity_ah,
        )
    if not vehicle.is_flat:
        inertia = vehicle.body.inertia()
        axes = np.concatenate([rotors.axes(), arms_m[:, 2:]], axis=1)
        numbers = numbers._replace(axes=axes, inertia=np.array([inertia, inverse(inertia)]))
    return numbers
