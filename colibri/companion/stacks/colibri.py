"""Colibri's own autopilot: offboard mode; its demand generator slews attitude setpoints."""

from colibri.companion.stacks.px4 import HOLD, LAND, OFFBOARD, STEADY
from colibri.companion.stacks.stack import Parameters, Response, Stack, TakeOff
from colibri.companion.stacks.thrust_curve import MiddleHovers
from colibri.mavlink.wire.dialect import mav
from colibri.plant.vehicle.description import Vehicle

_IDENTIFIED = Response((0.032, 0.032, 0.128), 0.010, 0.0, (4.0, 4.0, 2.0), (120.0, 120.0, 15.0), (0.014, 0.014, 0.010))
"""Result of --identify with profile `flight`, the same for any airframe."""


def _thrust(parameters: Parameters, vehicle: Vehicle) -> MiddleHovers:
    del parameters
    weight_n = vehicle.body.mass_kg * vehicle.gravity_m_s2
    return MiddleHovers(max_load=float(vehicle.max_wrench()[0]) / weight_n)


COLIBRI = Stack(
    name="colibri",
    autopilot=mav.MAV_AUTOPILOT_PX4,
    offboard=OFFBOARD,
    hold=HOLD,
    last_resort=LAND,
    steady=STEADY,
    streams={
        "ODOMETRY": 125.0,
        "CURRENT_MODE": 25.0,
        "EXTENDED_SYS_STATE": 5.0,
        "SYS_STATUS": 5.0,
        "ESTIMATOR_STATUS": 5.0,
        "BATTERY_STATUS": 1.0,
        "GLOBAL_POSITION_INT": 5.0,
    },
    parameters=("COM_OF_LOSS_T", "GF_MAX_HOR_DIST", "GF_MAX_VER_DIST"),
    rules=(),
    fence=("GF_MAX_HOR_DIST", "GF_MAX_VER_DIST"),
    thrust=_thrust,
    response=_IDENTIFIED,
    take_off=TakeOff.COMMAND_THEN_ARM,
    integers_by_bits=True,
)
