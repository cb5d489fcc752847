"""Colibri's own autopilot: offboard mode; its demand generator slews attitude setpoints."""

from dataclasses import replace

from colibri.companion.stacks.px4 import PX4
from colibri.companion.stacks.stack import Parameters, Response
from colibri.companion.stacks.thrust_curve import MiddleHovers
from colibri.plant.vehicle.description import Vehicle

_IDENTIFIED = Response((0.032, 0.032, 0.128), 0.010, 0.0, (4.0, 4.0, 2.0), (120.0, 120.0, 15.0), (0.014, 0.014, 0.010))
"""Result of --identify with profile `flight`, the same for any airframe."""


def _thrust(parameters: Parameters, vehicle: Vehicle) -> MiddleHovers:
    del parameters
    weight_n = vehicle.body.mass_kg * vehicle.gravity_m_s2
    return MiddleHovers(max_load=float(vehicle.max_wrench()[0]) / weight_n)


COLIBRI = replace(
    PX4,
    name="colibri",
    streams={
        "ODOMETRY": 125.0,
        "CURRENT_MODE": 25.0,
        "EXTENDED_SYS_STATE": 5.0,
        "SYS_STATUS": 5.0,
        "ESTIMATOR_STATUS": 5.0,
        "BATTERY_STATUS": 1.0,
        "GLOBAL_POSITION_INT": 5.0,
    },
    parameters=("COM_OF_LOSS_T", *PX4.fence),
    needed=(),
    rules=(),
    thrust=_thrust,
    response=_IDENTIFIED,
)
