"""A vehicle file from what a user can read, weigh or measure: data sheets, a ruler and a thrust stand.

Rotor lag and moments of inertia are estimated high: the law flies a vehicle that is quicker than its file, but not one
that is twice as slow.
"""

import csv
import io
import tomllib
from itertools import pairwise
from math import floor, isfinite, pi, radians, sqrt
from pathlib import Path
from typing import Literal, NamedTuple, TypeAlias

from colibri.common.config import SettingsError, read_settings
from colibri.common.elementary import cos, sin
from colibri.plant.vehicle.description import Vehicle, VehicleError, vehicle_names, vehicle_text
from colibri.plant.vehicle.rotor_numbering import FRAMES, Place

Order: TypeAlias = Literal["px4", "clockwise"]
Motor: TypeAlias = Literal["brushless", "brushed"]
LAYOUTS = ("x", "+", "h", *(name for name in FRAMES if name not in ("x", "+")))  # h is x, turning the other way
ORDERS: tuple[Order, ...] = ("px4", "clockwise")
MOTORS: tuple[Motor, ...] = ("brushless", "brushed")

_GRAVITY_M_S2 = 9.81
_M_PER_INCH = 0.0254
_RAD_S_PER_RPM = 2.0 * pi / 60.0
_CELL_FULL_V, _CELL_EMPTY_V = 4.2, 3.0
_MIN_THRUST_TO_WEIGHT = 1.05
_SMALL_M = 0.06  # smaller propellers turn on motors with or without brushes
_TOY_M = 0.1  # smaller propellers are steep, and have more drag for their thrust
_LOADED: dict[Motor, float] = {"brushless": 0.65, "brushed": 0.45}  # speed at full throttle over KV times voltage
_APART, _IN_WAKE = 0.1, 0.85
"""Coaxial rotors: half of what they are apart, in diameters; thrust of the lower one, by measurements of 0.8 to 0.9."""
_AIR_KG_M3, _BODY_KG_M3, _DRAG_COEFFICIENT, _AIRSPEED_M_S = 1.2, 400.0, 1.2, 5.0
"""Drag of a body with battery and motors: small ones are light for their size, as area grows with mass to the 2/3. The
rotors' grows with their speed, but not on small vehicles: that of the Crazyflie was identified without."""
_OTHER = {"ccw": "cw", "cw": "ccw"}
_UNITS = {
    "throttle": {"": 1.0, "percent": 0.01, "pct": 0.01, "%": 0.01},
    "thrust": {"n": 1.0, "g": 0.00981, "gf": 0.00981, "kg": 9.81, "kgf": 9.81},
    "speed": {"rpm": _RAD_S_PER_RPM, "rad/s": 1.0, "rad_s": 1.0},
    "current": {"a": 1.0},
}


class Propeller(NamedTuple):
    """A propeller, in metres. Pitch without a number is 0.45 of the diameter, below 100 mm 0.6."""

    diameter_m: float
    pitch_m: float
    pitch_given: bool


class ThrustStand(NamedTuple):
    """One rotor on a thrust stand."""

    max_thrust_n: float
    max_speed_rad_s: float | None
    thrust_coefficient: float | None  # N s², least squares over all points


class DataSheet(NamedTuple):
    """What is known of a vehicle; `None` is unknown."""

    name: str
    mass_kg: float
    arm_m: float  # centre to motor: half the wheelbase
    propeller: Propeller
    layout: str = "x"
    order: Order = "px4"
    motor: Motor | None = None
    kv_rpm_v: float | None = None
    cells: int | None = None
    hover_throttle: float | None = None  # part of the largest thrust: PX4's MPC_THR_HOVER, ArduPilot's MOT_THST_HOVER
    capacity_ah: float | None = None
    lag_s: float | None = None
    inertia_kg_m2: tuple[float, float, float] | None = None
    drag_n_s_m: float | None = None  # horizontal, of the whole vehicle in hover and slow flight
    stand: ThrustStand | None = None

    @property
    def motors(self) -> list[Place]:
        motors = FRAMES["x" if self.layout == "h" else self.layout].motors
        by_bearing = sorted(motors, key=lambda motor: (motor.bearing_deg % 360.0, -motor.level))
        return by_bearing if self.order == "clockwise" else list(motors)

    @property
    def rotors(self) -> float:
        """Number of rotors by thrust: those below others are in their wake."""
        return sum(_IN_WAKE if level < 0 else 1.0 for *_, level in self.motors)


def propeller_of(text: str) -> Propeller:
    """Read `10x4.5` (inches), `1045` (the same), `10`, `45mm` or `45x30mm`, or raise a VehicleError."""
    number = text.strip().lower()
    scale = 0.001 if number.endswith("mm") else _M_PER_INCH
    first, by, second = number.removesuffix("mm").partition("x")
    if not by and len(first) == 4 and first.isdigit() and scale == _M_PER_INCH:
        first, second = str(float(first[:2])), str(float(first[2:]) / 10.0)
        if float(first) > 30.0:
            first = str(float(first) / 10.0)
    try:
        diameter_m = scale * float(first)
        pitch_m = scale * float(second) if second else (0.45 if diameter_m >= _TOY_M else 0.6) * diameter_m
    except ValueError:
        diameter_m = pitch_m = 0.0
    if not (0.02 <= diameter_m <= 1.5 and 0.1 * diameter_m <= pitch_m <= 1.5 * diameter_m):
        raise VehicleError(
            f'--propeller "{text}": must be diameter x pitch in inches, 10x4.5, or in mm, 45x30mm'
            " (diameter 20 mm to 1.5 m, pitch 0.1 to 1.5 diameters)"
        )
    return Propeller(diameter_m, pitch_m, bool(second))


def thrust_stand_of(text: str) -> ThrustStand:
    """Read a thrust stand's CSV, with columns such as throttle, thrust_g and speed_rpm, or raise a VehicleError."""
    rows = [row for row in csv.reader(io.StringIO(text.lstrip("\ufeff"))) if any(cell.strip() for cell in row)]
    columns: dict[str, tuple[int, float]] = {}
    for place, head in enumerate(rows[0] if rows else []):
        words = head.strip().lower().replace("(", " ").replace(")", "").replace("[", " ").replace("]", "")
        kind, _, unit = words.replace(" ", "_").partition("_")
        kind, unit = ("speed", "rpm") if kind == "rpm" else (kind, unit.strip("_"))
        if kind in _UNITS:
            if unit not in _UNITS[kind]:
                known = ", ".join(f"{kind}_{each}" if each else kind for each in _UNITS[kind])
                raise VehicleError(f'column "{head.strip()}": its unit is missing or unknown: choose {known}')
            columns[kind] = (place, _UNITS[kind][unit])
    for kind in ("throttle", "thrust"):
        if kind not in columns:
            raise VehicleError(f"column {kind} is missing: columns are throttle, thrust_g, speed_rpm, current_a")
    points: list[dict[str, float]] = []
    for line, row in enumerate(rows[1:], 2):
        try:
            points.append({kind: scale * float(row[place]) for kind, (place, scale) in columns.items()})
        except (ValueError, IndexError):
            raise VehicleError(f'row {line} "{",".join(row)}": must have a number in each column') from None
        if not all(isfinite(number) and number >= 0.0 for number in points[-1].values()):
            raise VehicleError(f'row {line} "{",".join(row)}": numbers must be finite and not negative')
    top = max(points, key=lambda point: point["throttle"], default={"throttle": 0.0, "thrust": 0.0})
    if not 0.9 <= top["throttle"] <= 1.01:
        raise VehicleError(f"largest throttle {top['throttle']:g}: must reach 1 (or 100 in a column throttle_percent)")
    if not top["thrust"]:
        raise VehicleError("thrust at the largest throttle is 0: must be greater")
    fourth = sum(point.get("speed", 0.0) ** 4 for point in points)
    fit = sum(point["thrust"] * point.get("speed", 0.0) ** 2 for point in points) / fourth if fourth else None
    if "speed" in columns and not top["speed"]:
        raise VehicleError("speed at the largest throttle is 0: must be greater, or leave the column out")
    return ThrustStand(top["thrust"], top.get("speed"), fit)


class _Rotor(NamedTuple):
    coefficient: float
    coefficient_from: str
    max_speed: float
    max_speed_from: str


def vehicle_file(sheet: DataSheet) -> tuple[str, list[str]]:
    """Return a vehicle file in TOML, with a source for each number, and notes for the user.

    Raises:
        VehicleError: A number is missing or impossible; the message names the option.
    """
    _check(sheet)
    rotor, notes = _rotor(sheet)
    weight_n, max_n = sheet.mass_kg * _GRAVITY_M_S2, sheet.rotors * rotor.coefficient * rotor.max_speed**2
    ratio, hover = max_n / weight_n, sqrt(weight_n / (sheet.rotors * rotor.coefficient))
    if ratio < _MIN_THRUST_TO_WEIGHT:
        raise VehicleError(
            f"largest thrust {max_n:.3g} N is {floor(100.0 * ratio) / 100.0:g} times the weight: at least"
            f" {_MIN_THRUST_TO_WEIGHT} is required (look at --mass, --propeller, --kv, --cells)"
        )
    template = Path(__file__).with_name("new_vehicle.toml.in").read_text(encoding="utf-8")
    if sheet.capacity_ah is None:
        template = template.partition("\n[battery]")[0]
    sensors = vehicle_text("hummingbird").partition("# Sensors of a flight controller board")
    text = template.format(**_numbers(sheet, rotor, hover)) + "\n" + "".join(sensors[1:])
    try:
        read_settings(tomllib.loads(text), Vehicle)
    except (SettingsError, tomllib.TOMLDecodeError) as error:
        raise VehicleError(f"{sheet.name}: {error}") from error
    thrust = f"thrust {max_n:.3g} N, {ratio:.2f} times the weight"
    return text, [f"{thrust}; hover at {hover / rotor.max_speed:.2f} of the top speed", *notes]


def _check(sheet: DataSheet) -> None:
    limits = {
        "--mass": (sheet.mass_kg, 0.01, 500.0, "kg"),
        "--arm": (sheet.arm_m, 0.02, 5.0, "m, centre to motor (--wheelbase: twice that)"),
        "--kv": (sheet.kv_rpm_v, 10.0, 50_000.0, "rpm/V"),
        "--cells": (sheet.cells, 1, 28, "in series"),
        "--hover-throttle": (sheet.hover_throttle, 0.02, 0.95, "of the largest thrust"),
        "--capacity": (sheet.capacity_ah, 0.02, 500.0, "Ah"),
        "--lag": (sheet.lag_s, 0.001, 1.0, "s"),
        "--drag": (sheet.drag_n_s_m, 0.0, 50.0, "N s/m"),
    }
    for option, (value, least, most, unit) in limits.items():
        if value is not None and not least <= value <= most:
            raise VehicleError(f"{option} {value:g}: must lie between {least:g} and {most:g} {unit}")
    if sheet.name in vehicle_names():
        raise VehicleError(f'name "{sheet.name}" is that of a vehicle that comes with Colibri: choose another')
    bearings = sorted({motor.bearing_deg % 360.0 for motor in sheet.motors})
    apart_m = 2.0 * sheet.arm_m * sin(radians(0.5 * min(b - a for a, b in pairwise([*bearings, bearings[0] + 360.0]))))
    if sheet.propeller.diameter_m >= apart_m:
        raise VehicleError(
            f"--propeller of {sheet.propeller.diameter_m:.3g} m: neighbouring motors are {apart_m:.3g} m apart, so that"
            " propellers overlap (look at --arm: centre to motor)"
        )
    if sheet.motor is None and sheet.lag_s is None and (sheet.cells == 1 or sheet.propeller.diameter_m < _SMALL_M):
        raise VehicleError("--motor brushed or brushless is required for one cell or propellers below 60 mm")
    if sheet.capacity_ah is not None and sheet.cells is None:
        raise VehicleError("--capacity requires --cells")
    if sheet.hover_throttle is None and sheet.stand is None and (sheet.kv_rpm_v is None or sheet.cells is None):
        raise VehicleError("thrust is unknown: give --hover-throttle, --kv with --cells, or --thrust-stand FILE")


def _rotor(sheet: DataSheet) -> tuple[_Rotor, list[str]]:
    """Return thrust coefficient and top speed in rad/s: measured before computed."""
    stand, speed, speed_from = sheet.stand, None, ""
    notes: list[str] = []
    diameter_in, pitch_in = sheet.propeller.diameter_m / _M_PER_INCH, sheet.propeller.pitch_m / _M_PER_INCH
    coefficient = 1.858e-11 * float(diameter_in**3.5) * sqrt(pitch_in) / _RAD_S_PER_RPM**2  # N s², by static thrust
    origin = "estimated from the propeller"
    if sheet.kv_rpm_v is not None and sheet.cells is not None:
        loaded = _LOADED[sheet.motor or "brushless"]
        speed = loaded * sheet.kv_rpm_v * sheet.cells * _CELL_FULL_V * _RAD_S_PER_RPM
        speed_from = f"estimated: {loaded:g} of KV times the full battery's voltage"
    if stand is not None and stand.thrust_coefficient is not None and stand.max_speed_rad_s is not None:
        return _Rotor(stand.thrust_coefficient, "thrust stand", stand.max_speed_rad_s, "thrust stand"), notes
    thrust_n, thrust_from = (stand.max_thrust_n, "thrust stand") if stand is not None else (None, "")
    if thrust_n is None and sheet.hover_throttle is not None:
        thrust_n, thrust_from = sheet.mass_kg * _GRAVITY_M_S2 / sheet.rotors / sheet.hover_throttle, "hover throttle"
    if thrust_n is None:
        assert speed is not None
        return _Rotor(coefficient, origin, speed, speed_from), notes
    if speed is None:
        return _Rotor(coefficient, origin, sqrt(thrust_n / coefficient), f"{thrust_from}, by thrust_coefficient"), notes
    computed_n = coefficient * speed * speed
    if not 0.5 <= computed_n / thrust_n <= 2.0:
        notes.append(
            f"propeller, KV and cells give {computed_n:.3g} N a rotor, the {thrust_from} {thrust_n:.3g} N, which is"
            " used: look at both"
        )
    return _Rotor(thrust_n / speed**2, f"{thrust_from}, at max_speed", speed, speed_from), notes


def _numbers(sheet: DataSheet, rotor: _Rotor, hover: float) -> dict[str, str]:
    mass, arm, size = sheet.mass_kg, sheet.arm_m, sheet.propeller.diameter_m
    motors = sheet.motors
    places = [
        (arm * cos(radians(bearing)), -arm * sin(radians(bearing)), *([_APART * size * level] if level else []))
        for bearing, _, level in motors
    ]
    reverse = sheet.layout == "h" or (sheet.layout, sheet.order) == ("+", "clockwise")
    spins = [_OTHER[spin] if reverse else spin for _, spin, _ in motors]
    plane = mass * arm * arm
    inertia = sheet.inertia_kg_m2 or (0.27 * plane, 0.27 * plane, 0.48 * plane)
    lag = sheet.lag_s or (0.14 if sheet.motor == "brushed" else max(0.05 * size / 0.254, 0.02))
    drag, cells = sheet.drag_n_s_m, sheet.cells or 0
    pitch = "" if sheet.propeller.pitch_given else "; pitch estimated"
    by = "brushes" if sheet.motor == "brushed" else "size"
    body_drag = 0.5 * _AIR_KG_M3 * _DRAG_COEFFICIENT * (mass / _BODY_KG_M3) ** (2.0 / 3.0) * _AIRSPEED_M_S
    rotor_drag = 1.2 * mass * _GRAVITY_M_S2 / (2.0 * size * hover * hover)
    across = body_drag
    if size < _TOY_M:
        across, rotor_drag = body_drag + len(motors) * hover * rotor_drag, 0.0
    estimated_drag = "estimated, by the size of a body of 400 kg/m³, at 5 m/s; of the rotors by tip speed in hover"
    stacked = any(motor.level < 0 for motor in motors)
    in_wake = _texts(tuple(_IN_WAKE if motor.level < 0 else 1.0 for motor in motors))
    return {
        "name": '"' + sheet.name.replace("\\", "\\\\").replace('"', '\\"') + '"',
        "mass": _text(mass),
        "inertia": _texts(inertia),
        "inertia_from": "given" if sheet.inertia_kg_m2 else "estimated, high: 0.27 and 0.48 of mass times arm squared",
        "thrust": _text(rotor.coefficient),
        "thrust_from": rotor.coefficient_from + (pitch if "propeller" in rotor.coefficient_from else ""),
        "torque": _text(rotor.coefficient * size * (0.065 if size >= _TOY_M else 0.15)),
        "torque_from": f"estimated: thrust times {'0.065' if size >= _TOY_M else '0.15'} diameters",
        "rotor_inertia": _text(3e-5 * (size / 0.254) ** 4),
        "idle": _text(0.1 * rotor.max_speed),
        "speed": _text(rotor.max_speed),
        "speed_from": rotor.max_speed_from,
        "places": ", ".join(_texts(place) for place in places),
        "places_from": f"arm {_text(arm)} m, layout {sheet.layout}, order {sheet.order}",
        "spins": ", ".join(f'"{spin}"' for spin in spins),
        "strength": f"strength = {in_wake}  # estimated: lower rotors in the wake of upper ones\n" if stacked else "",
        "lag": _text(lag),
        "lag_from": "given" if sheet.lag_s else f"estimated, high, by {by}",
        "drag": _texts((across, across, 1.6 * body_drag) if drag is None else (drag, drag, drag)),
        "drag_from": estimated_drag if drag is None else "given, with the rotors'",
        "rotor_drag": _text(rotor_drag if drag is None else 0.0),
        "learned": "true" if drag is None else "false",
        "feet": ", ".join(_texts((0.6 * x, 0.6 * y)) for x, y, *_ in dict.fromkeys(place[:2] for place in places)),
        "depth": _text(0.3 * arm),
        "stiffness": _text(12_900.0 * mass),
        "damping": _text(143.0 * mass),
        "slip": _text(115.0 * mass),
        "full": _text(cells * _CELL_FULL_V),
        "empty": _text(cells * _CELL_EMPTY_V),
        "resistance": _text(cells * 0.021 / (sheet.capacity_ah or 1.0)),
        "capacity": _text(sheet.capacity_ah or 0.0),
    }


def _text(number: float) -> str:
    return f"{0.0 if abs(number) < 1e-12 else number:.5g}"


def _texts(numbers: tuple[float, ...]) -> str:
    return f"[{', '.join(map(_text, numbers))}]"
