"""Parameters of the assumed vehicle model."""

from collections.abc import Mapping
from typing import Any

from colibri.autopilot.parameters.number_paths import Number, Path, has
from colibri.plant.vehicle.description import MAX_ROTORS

_SPEED = "{speed}"
"""Placeholder for the unit of rotor speeds."""
_AXES = "XYZ"


def vehicle_numbers(tree: Mapping[str, Any]) -> list[Number]:
    speed = tree["rotors"]["speed_unit"]
    inside = f"({speed})" if "/" in speed else speed
    return [
        number._replace(unit=speed if number.unit == _SPEED else number.unit.replace(_SPEED, inside))
        for number in _VEHICLE
        if has(tree, number.path)
    ]


_PRODUCT = "Inertia matrix: element "


def _axes(
    name: str, key: Path, unit: str, maximum: float, what: str, scale: float, minimum: float = 0.0
) -> list[Number]:
    return [
        Number(name.format(axis), (*key, place), unit, minimum, maximum, what.format(axis.lower()), scale, 4)
        for place, axis in enumerate(_AXES)
    ]


def _rotors() -> list[Number]:
    numbers = []
    for rotor in range(MAX_ROTORS):
        for place, (axis, where) in enumerate((("X", "forward"), ("Y", "left"), ("Z", "up"))):
            path = ("rotors", "position_m", rotor, place)
            what = f"Rotor {rotor + 1}: position {where}"
            numbers.append(Number(f"VEH_ROT{rotor + 1}_{axis}", path, "m", -5.0, 5.0, what, decimals=4))
        for place, axis in enumerate(_AXES):
            what = f"Rotor {rotor + 1}: thrust direction, {axis.lower()}"
            numbers.append(Number(f"VEH_ROT{rotor + 1}_A{axis}", ("rotors", "axis", rotor, place), "", -1.0, 1.0, what))
        part = f"Rotor {rotor + 1}: fraction of thrust"
        numbers.append(Number(f"VEH_ROT{rotor + 1}_PART", ("rotors", "strength", rotor), "norm", 0.05, 1.0, part))
    return numbers


_VEHICLE = [
    Number("VEH_GRAVITY", ("gravity_m_s2",), "m/s^2", 1.0, 30.0, "Gravity", decimals=4),
    Number("VEH_MASS", ("body", "mass_kg"), "kg", 0.01, 100.0, "Mass", decimals=4),
    *_axes("VEH_I{0}{0}", ("body", "inertia_kg_m2"), "g m^2", 1e4, "Moment of inertia about {}", 1e-3, 1e-3),
    *(
        Number(
            f"VEH_I{axes}", ("body", "inertia_products_kg_m2", place), "g m^2", -1e4, 1e4, _PRODUCT + axes.lower(), 1e-3
        )
        for place, axes in enumerate(("XY", "XZ", "YZ"))
    ),
    *_axes("VEH_COM_{0}", ("body", "center_of_mass_m"), "m", 5.0, "Centre of mass along {}", 1.0, -5.0),
    Number(
        "VEH_CT", ("rotors", "thrust_coefficient"), f"uN/{_SPEED}^2", 1e-6, 1e6, "Rotor thrust coefficient", 1e-6, 6
    ),
    Number(
        "VEH_CQ", ("rotors", "torque_coefficient"), f"nN m/{_SPEED}^2", 1e-6, 1e6, "Rotor torque coefficient", 1e-9, 6
    ),
    Number("VEH_ROT_J", ("rotors", "inertia_kg_m2"), "mg m^2", 1e-6, 1e6, "Rotor inertia", 1e-6, 4),
    Number("VEH_ROT_MAX", ("rotors", "max_speed"), _SPEED, 1.0, 1e5, "Maximum rotor speed", 1.0, 1),
    Number("VEH_ROT_IDLE", ("rotors", "idle_speed"), _SPEED, 0.0, 1e5, "Idle rotor speed", 1.0, 1),
    *_rotors(),
    Number("VEH_LAG_UP", ("rotors", "lag", "time_constant_up_s"), "ms", 1.0, 1e3, "Rotor time constant, up", 1e-3),
    Number(
        "VEH_LAG_DOWN", ("rotors", "lag", "time_constant_down_s"), "ms", 1.0, 1e3, "Rotor time constant, down", 1e-3
    ),
    *_axes("VEH_DRAG_{0}", ("drag", "linear_n_s_m"), "N s/m", 10.0, "Airframe drag along {}", 1.0),
    Number("VEH_DRAG_ROT", ("drag", "rotor_coefficient"), f"uN s/(m {_SPEED})", 0.0, 1e6, "Rotor drag", 1e-6, 4),
    Number("VEH_BAT_FULL", ("battery", "full_voltage_v"), "V", 1.0, 100.0, "Full battery voltage", decimals=2),
    Number("VEH_BAT_EMPTY", ("battery", "empty_voltage_v"), "V", 1.0, 100.0, "Empty battery voltage", 1.0, 2),
    Number("VEH_BAT_OHM", ("battery", "resistance_ohm"), "mOhm", 0.0, 1e3, "Battery resistance", 1e-3, 2),
    Number("VEH_BAT_AH", ("battery", "capacity_ah"), "mAh", 10.0, 1e6, "Battery capacity", 1e-3, 0),
    Number("VEH_BAT_EFF", ("battery", "efficiency"), "norm", 0.05, 1.0, "Battery efficiency"),
]
