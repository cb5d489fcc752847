"""PX4: offboard mode by body rates and thrust.

Sources: PX4 guide, Offboard Mode; PX4 Parameter Reference (Multicopter Position Control, Motor Control, Geofence).
"""

from colibri.companion.stacks.stack import (
    MAX_STALE_S,
    ROUNDING,
    ParameterRule,
    Parameters,
    Response,
    Stack,
    TakeOffOrder,
)
from colibri.companion.stacks.thrust_curve import ThrustCurve
from colibri.mavlink.client.modes import PX4_MODES
from colibri.mavlink.wire.dialect import mav
from colibri.plant.vehicle.description import Vehicle

OFFBOARD, HOLD, LAND = PX4_MODES["Offboard"], PX4_MODES["Hold"], PX4_MODES["Land"]
_HOVER = 0.5


def _thrust(parameters: Parameters, vehicle: Vehicle) -> ThrustCurve:
    return ThrustCurve(
        hover=parameters.get("MPC_THR_HOVER", _HOVER),
        expo=parameters.get("THR_MDL_FAC", 0.0),
        quadratic=vehicle.rotors.control == "speed",
    )


PX4 = Stack(
    name="px4",
    autopilot=mav.MAV_AUTOPILOT_PX4,
    offboard=OFFBOARD,
    hold=HOLD,
    last_resort=LAND,
    steady=frozenset({HOLD.custom, PX4_MODES["Takeoff"].custom}),
    streams={
        "ODOMETRY": 100.0,
        "ATTITUDE_QUATERNION": 50.0,
        "LOCAL_POSITION_NED": 50.0,
        "CURRENT_MODE": 25.0,
        "EXTENDED_SYS_STATE": 5.0,
        "SYS_STATUS": 5.0,
        "ESTIMATOR_STATUS": 5.0,
        "BATTERY_STATUS": 1.0,
        "GLOBAL_POSITION_INT": 5.0,
    },
    parameters=(
        "MPC_THR_HOVER",
        "THR_MDL_FAC",
        "COM_OF_LOSS_T",
        "COM_RC_OVERRIDE",
        "GF_MAX_HOR_DIST",
        "GF_MAX_VER_DIST",
    ),
    needed=("MPC_THR_HOVER", "THR_MDL_FAC", "COM_OF_LOSS_T"),
    rules=(
        ParameterRule(
            "COM_OF_LOSS_T",
            lambda value: value <= MAX_STALE_S + ROUNDING,
            f"set COM_OF_LOSS_T to {MAX_STALE_S:g}: PX4 follows the last body rates for as long",
        ),
    ),
    fence=("GF_MAX_HOR_DIST", "GF_MAX_VER_DIST"),
    thrust=_thrust,
    response=Response((0.055, 0.055, 0.3), 0.04, 0.04, (3.8, 3.8, 2.0), (12.0, 12.0, 6.0)),
    take_off=TakeOffOrder.COMMAND_THEN_ARM,
    integers_by_bits=True,
)
