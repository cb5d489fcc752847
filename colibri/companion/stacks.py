"""Flight stacks as values, and their recognition.

Sources: PX4 guide, Offboard Mode; PX4 Parameter Reference (Multicopter Position Control, Motor Control, Geofence).
ArduPilot, Copter Commands in Guided Mode (SET_ATTITUDE_TARGET, GUID_OPTIONS); Copter parameters;
AP_Motors_Thrust_Linearization.cpp.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

from colibri.companion.stack import (
    MAX_STALE_S,
    ROUNDING,
    MiddleHovers,
    ParameterRule,
    Parameters,
    Response,
    Stack,
    TakeOffOrder,
    ThrustCurve,
)
from colibri.mavlink.client.modes import COPTER_MODES, PX4_MODES
from colibri.mavlink.services.identity import PRODUCT
from colibri.mavlink.wire.dialect import AUTOPILOT_GENERIC, mav
from colibri.plant.vehicle.description import Vehicle

OFFBOARD, HOLD, LAND = PX4_MODES["Offboard"], PX4_MODES["Hold"], PX4_MODES["Land"]
_GUIDED, _LOITER, _COPTER_LAND, _BRAKE = (COPTER_MODES[name] for name in ("Guided", "Loiter", "Land", "Brake"))
_THRUST_AS_THRUST = 8
"""Bit 3 of GUID_OPTIONS; without it a thrust is a climb rate."""
_STATUS_HZ = {"EXTENDED_SYS_STATE": 5.0, "SYS_STATUS": 5.0, "BATTERY_STATUS": 1.0, "GLOBAL_POSITION_INT": 5.0}
_PX4_STATUS_HZ = {"CURRENT_MODE": 25.0, "ESTIMATOR_STATUS": 5.0, **_STATUS_HZ}


def _curve(numbers: Mapping[str, tuple[str, float]]) -> Callable[[Parameters, Vehicle], ThrustCurve]:
    """Return a thrust curve by the stack's parameters, each with its default."""

    def thrust(parameters: Parameters, vehicle: Vehicle) -> ThrustCurve:
        found = {number: parameters.get(name, default) for number, (name, default) in numbers.items()}
        return ThrustCurve(**found, quadratic=vehicle.rotors.control == "speed")

    return thrust


def _times_out(name: str, stack: str) -> ParameterRule:
    action = f"set {name} to {MAX_STALE_S:g}: {stack} follows the last body rates for as long"
    return ParameterRule(name, lambda value: value <= MAX_STALE_S + ROUNDING, action)


PX4 = Stack(
    name="px4",
    autopilot=mav.MAV_AUTOPILOT_PX4,
    offboard=OFFBOARD,
    hold=HOLD,
    last_resort=LAND,
    steady=frozenset({HOLD.custom, PX4_MODES["Takeoff"].custom}),
    streams={"ODOMETRY": 100.0, "ATTITUDE_QUATERNION": 50.0, "LOCAL_POSITION_NED": 50.0, **_PX4_STATUS_HZ},
    needed=("MPC_THR_HOVER", "THR_MDL_FAC", "COM_OF_LOSS_T"),
    optional=("COM_RC_OVERRIDE",),
    rules=(_times_out("COM_OF_LOSS_T", "PX4"),),
    fence=("GF_MAX_HOR_DIST", "GF_MAX_VER_DIST"),
    thrust=_curve({"hover": ("MPC_THR_HOVER", 0.5), "expo": ("THR_MDL_FAC", 0.0)}),
    response=Response((0.055, 0.055, 0.3), 0.04, 0.04, (3.8, 3.8, 2.0), (12.0, 12.0, 6.0)),
    take_off=TakeOffOrder.COMMAND_THEN_ARM,
    integers_by_bits=True,
)
_ARDUPILOT_CURVE = {
    "hover": ("MOT_THST_HOVER", 0.35),
    "expo": ("MOT_THST_EXPO", 0.65),
    "spin_min": ("MOT_SPIN_MIN", 0.15),
    "spin_max": ("MOT_SPIN_MAX", 0.95),
}
ARDUPILOT = Stack(
    name="ardupilot",
    autopilot=mav.MAV_AUTOPILOT_ARDUPILOTMEGA,
    offboard=_GUIDED,
    hold=_LOITER,
    last_resort=_COPTER_LAND,
    steady=frozenset({_LOITER.custom, _BRAKE.custom}),
    streams={"ATTITUDE_QUATERNION": 100.0, "LOCAL_POSITION_NED": 100.0, "HEARTBEAT": 25.0, **_STATUS_HZ},
    needed=(*(name for name, _ in _ARDUPILOT_CURVE.values()), "GUID_OPTIONS", "GUID_TIMEOUT"),
    optional=("FENCE_ENABLE",),
    rules=(
        ParameterRule(
            "GUID_OPTIONS",
            lambda value: bool(int(value) & _THRUST_AS_THRUST),
            "add 8 to GUID_OPTIONS: a thrust is to be a thrust, not a climb rate",
        ),
        _times_out("GUID_TIMEOUT", "ArduPilot"),
    ),
    fence=("FENCE_RADIUS", "FENCE_ALT_MAX"),
    thrust=_curve(_ARDUPILOT_CURVE),
    response=Response((0.03, 0.03, 0.2), 0.026, 0.03, (3.8, 3.8, 1.5), (18.0, 18.0, 4.0)),
    take_off=TakeOffOrder.ARM_THEN_COMMAND,
    integers_by_bits=False,
)


_IDENTIFIED = Response((0.032, 0.032, 0.128), 0.010, 0.0, (4.0, 4.0, 2.0), (120.0, 120.0, 15.0), (0.014, 0.014, 0.010))
"""Result of --identify with profile `flight`, the same for any airframe."""


def _colibri_thrust(parameters: Parameters, vehicle: Vehicle) -> MiddleHovers:
    del parameters
    weight_n = vehicle.body.mass_kg * vehicle.gravity_m_s2
    return MiddleHovers(max_load=float(vehicle.max_wrench()[0]) / weight_n)


COLIBRI = replace(
    PX4,
    name="colibri",
    streams={"ODOMETRY": 125.0, **_PX4_STATUS_HZ},
    needed=(),
    optional=("COM_OF_LOSS_T",),
    rules=(),
    thrust=_colibri_thrust,
    response=_IDENTIFIED,
)
STACKS: dict[str, Stack] = {stack.name: stack for stack in (PX4, ARDUPILOT, COLIBRI)}
_BY_AUTOPILOT = {PX4.autopilot: PX4, ARDUPILOT.autopilot: ARDUPILOT}


def recognised(autopilot: int, uid2: bytes) -> Stack | None:
    """Return the stack of a HEARTBEAT's `autopilot` and an AUTOPILOT_VERSION's `uid2`, if it is known."""
    if autopilot in (PX4.autopilot, AUTOPILOT_GENERIC) and uid2.startswith(PRODUCT):
        return COLIBRI
    return _BY_AUTOPILOT.get(autopilot)
