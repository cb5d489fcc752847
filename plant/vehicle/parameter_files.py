"""A vehicle as parameters of PX4 and ArduPilot: mixer, thrust curve, hover thrust, GPS delay.

Hover thrust is the weight as a part of the thrust between the curve's ends. Sources: PX4 Parameter Reference;
ArduPilot, AP_Motors_Thrust_Linearization.cpp, AP_Motors_Class.h, AP_GPS and SITL parameters.
"""

from collections.abc import Callable
from typing import Final, TypeAlias

from colibri.mavlink.parameters.store import ParamType
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT
from colibri.plant.vehicle.description import Rotors, Vehicle, VehicleError

Values: TypeAlias = dict[str, int | float]  # by name; integers are of type INT32, floats of type REAL32

PX4_DELAYS: Final = ("SENS_GPS0_DELAY", "SENS_GNSS0_DELAY", "EKF2_GPS_DELAY")
"""The GPS delay, ms: since March 2026, after that, and before. A PX4 refuses unknown names."""
_EKF2_DELAY_MAX_MS = 200
_PX4_BEGINS_WITH: Final = (
    ("_PX", 0.0, 1e-6),
    ("_PY", 0.0, 1e-6),
    ("_KM", 0.05, 1e-6),
    *((name, 110, 1) for name in PX4_DELAYS),
)
"""PX4's defaults before its airframe changes them, by the ends of names, and a negligible step."""
_PX4_CT = 6.5
_SPIN_MIN = 0.15
_MAX_SPIN_MIN = 0.3


_RANGES = {
    "MPC_THR_HOVER": (0.1, 0.8),
    PX4_DELAYS[0]: (0.0, 300.0),
    "MOT_THST_HOVER": (0.125, 0.6875),
    "GPS1_DELAY_MS": (0.0, 250.0),
}


def px4_parameters(vehicle: Vehicle) -> Values:
    rotors = _alike(vehicle)
    values: Values = {"CA_AIRFRAME": 0, "CA_ROTOR_COUNT": len(rotors.position_m)}
    torque_m = rotors.torque_coefficient / rotors.thrust_coefficient
    points_m, axes = vehicle.rotors.points_m(), rotors.axes()
    for motor, rotor in enumerate(rotors.px4_numbering().rotors):
        x, y, z = points_m[rotor].tolist()
        values[f"CA_ROTOR{motor}_PX"] = x
        values[f"CA_ROTOR{motor}_PY"] = 0.0 - y
        if z != 0.0:
            values[f"CA_ROTOR{motor}_PZ"] = -z
        if rotors.axis:
            forward, left, up = axes[rotor].tolist()
            along = zip("XYZ", (forward, -left, -up), strict=True)
            values |= {f"CA_ROTOR{motor}_A{axis}": 0.0 + part for axis, part in along}
        if len(set(rotors.strength)) > 1:
            values[f"CA_ROTOR{motor}_CT"] = _PX4_CT * rotors.strength[rotor]
        values[f"CA_ROTOR{motor}_KM"] = torque_m if rotors.direction[rotor] == "ccw" else -torque_m
    values["THR_MDL_FAC"] = 1.0 if rotors.control == "speed" else 0.0
    values["MPC_THR_HOVER"] = _within("MPC_THR_HOVER", vehicle, "hover thrust", _hover_thrust(vehicle))
    if vehicle.sensors is not None:
        delay_ms = px4_gps_delay_ms(vehicle)
        _within(PX4_DELAYS[0], vehicle, "sensors.gps.delay_s in ms", delay_ms)
        values |= dict.fromkeys(PX4_DELAYS[:2], delay_ms) | {PX4_DELAYS[2]: float(delay_ms)}
        if delay_ms > _EKF2_DELAY_MAX_MS:
            values["EKF2_DELAY_MAX"] = float(delay_ms)
        if vehicle.sensors.rangefinder is not None:
            values["EKF2_RNG_DELAY"] = 0.0
    return values


def ardupilot_parameters(vehicle: Vehicle) -> Values:
    """Return the parameters of ArduPilot's SITL, which simulates the sensors itself: both ends of the GPS delay."""
    rotors = _alike(vehicle)
    spin_min, expo = ardupilot_thrust_curve(rotors)
    frame_class, frame_type = rotors.numbering().ardupilot_frame
    if spin_min > _MAX_SPIN_MIN:
        why = f"ArduPilot's MOT_SPIN_MIN is at most {_MAX_SPIN_MIN:g}, not {spin_min:.2g}"
        raise VehicleError(f"{vehicle.name}: rotors.idle_speed: {why}")
    least = rotors.speeds_of((spin_min,))[0] ** 2
    hover = (_hover_thrust(vehicle) - least) / (1.0 - least)
    values: Values = {
        "FRAME_CLASS": frame_class,
        "FRAME_TYPE": frame_type,
        "MOT_PWM_MIN": 1000,
        "MOT_PWM_MAX": 2000,
        "MOT_SPIN_MIN": spin_min,
        "MOT_SPIN_MAX": 1.0,
        "MOT_THST_EXPO": expo,
        "MOT_THST_HOVER": _within("MOT_THST_HOVER", vehicle, "hover thrust", hover),
    }
    values["BATT_MONITOR"] = 4  # voltage and current; without a monitor ArduCopter hides BATT_FS_* and its limits
    if vehicle.battery is not None:
        values["BATT_CAPACITY"] = round(1e3 * vehicle.battery.capacity_ah)
    if vehicle.sensors is not None:
        delay_ms = round(vehicle.sensors.gps.delay_s * 1e3)
        _within("GPS1_DELAY_MS", vehicle, "sensors.gps.delay_s in ms", delay_ms)
        values["SIM_GPS1_LAG_MS"] = delay_ms
        values["GPS1_DELAY_MS"] = max(1, delay_ms)  # 0 is whatever the receiver's driver assumes
    return values


def px4_gps_delay_ms(vehicle: Vehicle) -> int:
    assert vehicle.sensors is not None, "what has no sensors has no delays"
    return round(vehicle.sensors.gps.delay_s * 1e3)


def ardupilot_thrust_curve(rotors: Rotors) -> tuple[float, float]:
    """Return ArduPilot's MOT_SPIN_MIN s and MOT_THST_EXPO e, where MOT_SPIN_MAX is 1.

    A thrust T of 0 to 1 is the control s + (1 - s) x, where T = (1 - e) x + e x². If a control is speed, e = (1 - s) /
    (1 + s) is exact; if it is thrust, e = 0.
    """
    idle = rotors.idle_speed / rotors.max_speed
    spin_min = max(_SPIN_MIN, rotors.controls_of((idle,))[0])
    return spin_min, (1.0 - spin_min) / (1.0 + spin_min) if rotors.control == "speed" else 0.0


def px4_file(vehicle: Vehicle, remark: str) -> str:
    """Return PX4's parameters as QGroundControl reads them."""
    lines = [f"# {remark}", "#", "# Vehicle-Id Component-Id Name Value Type"]
    for name, value in px4_parameters(vehicle).items():
        kind = ParamType.INT if isinstance(value, int) else ParamType.REAL
        if name == PX4_DELAYS[0]:
            lines.append("# The delay of GPS by its three names: a PX4 has one of them, and passes over the others.")
        lines.append("\t".join(("1", str(AUTOPILOT_COMPONENT), name, _px4_text(name, value), str(kind.value))))
    return "\n".join(lines) + "\n"


def ardupilot_file(vehicle: Vehicle, remark: str) -> str:
    """Return ArduPilot's parameters as its SITL, MAVProxy and Mission Planner read them."""
    lines = [f"# {remark}", *(f"{name} {_text(value)}" for name, value in ardupilot_parameters(vehicle).items())]
    return "\n".join(lines) + "\n"


FILES: Final[dict[str, Callable[[Vehicle, str], str]]] = {"px4": px4_file, "ardupilot": ardupilot_file}


def _alike(vehicle: Vehicle) -> Rotors:
    """Return the rotors; the lower ones of coaxial rotors may be weaker, by their upper ones' wake."""
    rotors = vehicle.rotors
    strengths = {(x, y): set[float]() for x, y, _ in rotors.points_m().tolist()}
    for (x, y, _), part in zip(rotors.points_m().tolist(), rotors.strength, strict=True):
        strengths[x, y].add(part)
    if len(set(map(frozenset, strengths.values()))) > 1:
        raise VehicleError(f"{vehicle.name}: rotors.strength: PX4 and ArduPilot take all rotors to be alike")
    return rotors


def _hover_thrust(vehicle: Vehicle) -> float:
    weight_n = vehicle.body.mass_kg * vehicle.gravity_m_s2
    return weight_n / float(vehicle.max_wrench()[0])


def _within(name: str, vehicle: Vehicle, what: str, value: float) -> float:
    lowest, highest = _RANGES[name]
    if not lowest <= value <= highest:
        raise VehicleError(f"{vehicle.name}: {what} is {value:.3g}, and {name} is {lowest:g} to {highest:g}")
    return value


def _px4_text(name: str, value: float) -> str:
    """Return a value as PX4 must receive it before its airframe is read.

    PX4 ignores its own default, and the airframe's would apply: a neighbouring value is written instead.
    """
    for end, begins_with, step in _PX4_BEGINS_WITH:
        if name.endswith(end) and value == begins_with:
            return _text(value + step)
    return _text(value)


def _text(value: float) -> str:
    return f"{value:.7g}"
