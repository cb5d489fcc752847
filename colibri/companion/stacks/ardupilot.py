"""ArduPilot's Copter: GUIDED mode by body rates and thrust.

Sources: ArduPilot, Copter Commands in Guided Mode (SET_ATTITUDE_TARGET, GUID_OPTIONS); Copter parameters;
AP_Motors_Thrust_Linearization.cpp.
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
from colibri.mavlink.client.modes import COPTER_MODES
from colibri.mavlink.wire.dialect import mav
from colibri.plant.vehicle.description import Vehicle

_THRUST_AS_THRUST = 8
"""Bit 3 of GUID_OPTIONS; without it a thrust is a climb rate."""
_HOVER, _EXPO, _SPIN_MIN, _SPIN_MAX = 0.35, 0.65, 0.15, 0.95
"""ArduPilot's defaults."""


def _thrust(parameters: Parameters, vehicle: Vehicle) -> ThrustCurve:
    return ThrustCurve(
        hover=parameters.get("MOT_THST_HOVER", _HOVER),
        expo=parameters.get("MOT_THST_EXPO", _EXPO),
        spin_min=parameters.get("MOT_SPIN_MIN", _SPIN_MIN),
        spin_max=parameters.get("MOT_SPIN_MAX", _SPIN_MAX),
        quadratic=vehicle.rotors.control == "speed",
    )


GUIDED, LOITER, LAND, BRAKE = (COPTER_MODES[name] for name in ("Guided", "Loiter", "Land", "Brake"))

ARDUPILOT = Stack(
    name="ardupilot",
    autopilot=mav.MAV_AUTOPILOT_ARDUPILOTMEGA,
    offboard=GUIDED,
    hold=LOITER,
    last_resort=LAND,
    steady=frozenset({LOITER.custom, BRAKE.custom}),
    streams={
        "ATTITUDE_QUATERNION": 100.0,
        "LOCAL_POSITION_NED": 100.0,
        "HEARTBEAT": 25.0,
        "EXTENDED_SYS_STATE": 5.0,
        "SYS_STATUS": 5.0,
        "BATTERY_STATUS": 1.0,
        "GLOBAL_POSITION_INT": 5.0,
    },
    parameters=(
        "MOT_THST_HOVER",
        "MOT_THST_EXPO",
        "MOT_SPIN_MIN",
        "MOT_SPIN_MAX",
        "GUID_OPTIONS",
        "GUID_TIMEOUT",
        "FENCE_ENABLE",
        "FENCE_RADIUS",
        "FENCE_ALT_MAX",
    ),
    needed=("MOT_THST_HOVER", "MOT_THST_EXPO", "MOT_SPIN_MIN", "MOT_SPIN_MAX", "GUID_OPTIONS", "GUID_TIMEOUT"),
    rules=(
        ParameterRule(
            "GUID_OPTIONS",
            lambda value: bool(int(value) & _THRUST_AS_THRUST),
            "add 8 to GUID_OPTIONS: a thrust is to be a thrust, not a climb rate",
        ),
        ParameterRule(
            "GUID_TIMEOUT",
            lambda value: value <= MAX_STALE_S + ROUNDING,
            f"set GUID_TIMEOUT to {MAX_STALE_S:g}: ArduPilot follows the last body rates for as long",
        ),
    ),
    fence=("FENCE_RADIUS", "FENCE_ALT_MAX"),
    thrust=_thrust,
    response=Response((0.03, 0.03, 0.2), 0.026, 0.03, (3.8, 3.8, 1.5), (18.0, 18.0, 4.0)),
    take_off=TakeOffOrder.ARM_THEN_COMMAND,
    integers_by_bits=False,
)
