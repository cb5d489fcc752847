"""A vehicle as parameters of PX4 and ArduPilot: mixer, thrust curve, hover thrust, delay of the GPS receiver.

PX4's mixer takes each rotor's place and torque, ArduPilot's a frame type. Both turn a thrust into a control by a curve,
whose other end is `Rotors.speeds_of`; hover thrust is what the weight needs of the thrust between the curve's ends.

Sources: PX4 Parameter Reference (Geometry, Motor Control, Multicopter Position Control, Sensors, EKF2); ArduPilot,
AP_Motors_Thrust_Linearization.cpp, AP_Motors_Class.h, AP_GPS and SITL parameters.
"""

from collections.abc import Callable
from typing import Final, NamedTuple, TypeAlias

from colibri.mavlink.parameters.store import Kind
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT
from colibri.plant.vehicle.description import Rotors, Vehicle, VehicleError

Values: TypeAlias = dict[str, int | float]
"""Parameters by name: integers are of type INT32, floats of type REAL32."""

PX4_DELAYS: Final = ("SENS_GPS0_DELAY", "SENS_GNSS0_DELAY", "EKF2_GPS_DELAY")
"""The GPS receiver's delay, ms: since March 2026, after that, and before. A PX4 refuses those that it does not have."""
_EKF2_DELAY_MAX_MS = 200
_PX4_BEGINS_WITH: Final = (
    ("_PX", 0.0, 1e-6),
    ("_PY", 0.0, 1e-6),
    ("_KM", 0.05, 1e-6),
    *((name, 110, 1) for name in PX4_DELAYS),
)
"""What PX4 has before its airframe changes it, by the ends of names, and a step that is next to nothing."""
_SPIN_MIN = 0.15
_MAX_SPIN_MIN = 0.3


class _Range(NamedTuple):
    """What a parameter may be."""

    name: str
    lowest: float
    highest: float


_PX4_HOVER, _PX4_DELAY_MS = _Range("MPC_THR_HOVER", 0.1, 0.8), _Range(PX4_DELAYS[0], 0.0, 300.0)
_ARDUPILOT_HOVER, _ARDUPILOT_DELAY_MS = _Range("MOT_THST_HOVER", 0.125, 0.6875), _Range("GPS1_DELAY_MS", 0.0, 250.0)


def px4_parameters(vehicle: Vehicle) -> Values:
    """Return the parameters by which PX4 flies a vehicle.

    Raises:
        VehicleError: PX4 has no parameters for such a vehicle.
    """
    rotors = _alike(vehicle)
    values: Values = {"CA_AIRFRAME": 0, "CA_ROTOR_COUNT": len(rotors.position_m)}
    torque_m = rotors.torque_coefficient / rotors.thrust_coefficient
    for motor, rotor in enumerate(rotors.numbering().rotors):
        x, y = rotors.position_m[rotor]
        values[f"CA_ROTOR{motor}_PX"] = x
        values[f"CA_ROTOR{motor}_PY"] = 0.0 - y
        values[f"CA_ROTOR{motor}_KM"] = torque_m if rotors.direction[rotor] == "ccw" else -torque_m
    values["THR_MDL_FAC"] = 1.0 if rotors.control == "speed" else 0.0
    values["MPC_THR_HOVER"] = _within(_PX4_HOVER, vehicle, "hover thrust", _hover_thrust(vehicle))
    if vehicle.sensors is not None:
        delay_ms = px4_gps_delay_ms(vehicle)
        _within(_PX4_DELAY_MS, vehicle, "sensors.gps.delay_s in ms", delay_ms)
        values |= dict.fromkeys(PX4_DELAYS[:2], delay_ms) | {PX4_DELAYS[2]: float(delay_ms)}
        if delay_ms > _EKF2_DELAY_MAX_MS:
            values["EKF2_DELAY_MAX"] = float(delay_ms)
        if vehicle.sensors.rangefinder is not None:
            values["EKF2_RNG_DELAY"] = 0.0
    return values


def ardupilot_parameters(vehicle: Vehicle) -> Values:
    """Return the parameters by which ArduPilot's SITL flies a vehicle.

    Its sensors are those that ArduPilot simulates: both ends of the GPS receiver's delay are among the parameters.

    Raises:
        VehicleError: ArduPilot has no parameters for such a vehicle.
    """
    rotors = _alike(vehicle)
    spin_min, expo = ardupilot_thrust_curve(rotors)
    if spin_min > _MAX_SPIN_MIN:
        why = f"ArduPilot's MOT_SPIN_MIN is at most {_MAX_SPIN_MIN:g}, not {spin_min:.2g}"
        raise VehicleError(f"{vehicle.name}: rotors.idle_speed: {why}")
    least = _thrust_at(rotors, spin_min)
    hover = (_hover_thrust(vehicle) - least) / (1.0 - least)
    values: Values = {
        "FRAME_CLASS": 1,
        "FRAME_TYPE": rotors.numbering().ardupilot_frame_type,
        "MOT_PWM_MIN": 1000,
        "MOT_PWM_MAX": 2000,
        "MOT_SPIN_MIN": spin_min,
        "MOT_SPIN_MAX": 1.0,
        "MOT_THST_EXPO": expo,
        "MOT_THST_HOVER": _within(_ARDUPILOT_HOVER, vehicle, "hover thrust", hover),
    }
    if vehicle.sensors is not None:
        delay_ms = round(vehicle.sensors.gps.delay_s * 1e3)
        _within(_ARDUPILOT_DELAY_MS, vehicle, "sensors.gps.delay_s in ms", delay_ms)
        values["SIM_GPS1_LAG_MS"] = delay_ms
        values["GPS1_DELAY_MS"] = max(1, delay_ms)  # 0 is whatever the receiver's driver assumes
    return values


def px4_gps_delay_ms(vehicle: Vehicle) -> int:
    """Return the delay of a vehicle's GPS receiver as PX4 has it, ms; the vehicle has sensors."""
    assert vehicle.sensors is not None, "what has no sensors has no delays"
    return round(vehicle.sensors.gps.delay_s * 1e3)


def ardupilot_thrust_curve(rotors: Rotors) -> tuple[float, float]:
    """Return ArduPilot's MOT_SPIN_MIN and MOT_THST_EXPO, where MOT_SPIN_MAX is 1.

    A thrust T of 0 to 1 is the control s + (1 - s) x, where T = (1 - e) x + e x². If a control is speed, the thrust
    over that of s goes with (s + (1 - s) x)² - s², so that e = (1 - s) / (1 + s) is exact; if it is thrust, e = 0.
    """
    idle = rotors.idle_speed / rotors.max_speed
    spin_min = max(_SPIN_MIN, rotors.controls_of((idle,) * 4)[0])
    return spin_min, (1.0 - spin_min) / (1.0 + spin_min) if rotors.control == "speed" else 0.0


def px4_file(vehicle: Vehicle, remark: str) -> str:
    """Return PX4's parameters as QGroundControl reads them, with a `remark` in the first line.

    Raises:
        VehicleError: PX4 has no parameters for such a vehicle.
    """
    lines = [f"# {remark}", "#", "# Vehicle-Id Component-Id Name Value Type"]
    for name, value in px4_parameters(vehicle).items():
        kind = Kind.INT if isinstance(value, int) else Kind.REAL
        if name == PX4_DELAYS[0]:
            lines.append("# The delay of GPS by its three names: a PX4 has one of them, and passes over the others.")
        lines.append("\t".join(("1", str(AUTOPILOT_COMPONENT), name, _px4_text(name, value), str(kind.value))))
    return "\n".join(lines) + "\n"


def ardupilot_file(vehicle: Vehicle, remark: str) -> str:
    """Return ArduPilot's parameters as its SITL, MAVProxy and Mission Planner read them, a `remark` in the first line.

    Raises:
        VehicleError: ArduPilot has no parameters for such a vehicle.
    """
    lines = [f"# {remark}", *(f"{name} {_text(value)}" for name, value in ardupilot_parameters(vehicle).items())]
    return "\n".join(lines) + "\n"


FILES: Final[dict[str, Callable[[Vehicle, str], str]]] = {"px4": px4_file, "ardupilot": ardupilot_file}
"""Whose parameter files there are, and what writes them."""


def _alike(vehicle: Vehicle) -> Rotors:
    """Return the rotors, which are alike.

    Raises:
        VehicleError: They are not: mixers of other autopilots know no weak rotor.
    """
    if len(set(vehicle.rotors.strength)) > 1:
        raise VehicleError(f"{vehicle.name}: rotors.strength: PX4 and ArduPilot take all rotors to be alike")
    return vehicle.rotors


def _hover_thrust(vehicle: Vehicle) -> float:
    """Return the part of the largest thrust that carries the weight."""
    weight_n = vehicle.body.mass_kg * vehicle.gravity_m_s2
    return weight_n / float(vehicle.max_wrench()[0])


def _thrust_at(rotors: Rotors, control: float) -> float:
    """Return the part of the largest thrust at a control of all rotors."""
    return rotors.speeds_of((control,) * 4)[0] ** 2


def _within(allowed: _Range, vehicle: Vehicle, what: str, value: float) -> float:
    """Return a value that a parameter may have.

    Raises:
        VehicleError: It may not.
    """
    if not allowed.lowest <= value <= allowed.highest:
        limits = f"{allowed.name} is {allowed.lowest:g} to {allowed.highest:g}"
        raise VehicleError(f"{vehicle.name}: {what} is {value:.3g}, and {limits}")
    return value


def _px4_text(name: str, value: float) -> str:
    """Return a value as PX4 must be given it before its airframe is read.

    It passes over one that it has already, and the airframe's then counts: the value beside that is given in its place.
    """
    for end, begins_with, step in _PX4_BEGINS_WITH:
        if name.endswith(end) and value == begins_with:
            return _text(value + step)
    return _text(value)


def _text(value: float) -> str:
    return f"{value:.7g}"
