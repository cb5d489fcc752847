"""Parameters of the autopilot: control law, vehicle model, behaviour, failsafes."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from colibri.autopilot.commander.rules.failsafe_parameters import failsafe_parameters
from colibri.autopilot.control.law_files import table_of
from colibri.autopilot.control.profile import Profile
from colibri.autopilot.errors import AutopilotError
from colibri.autopilot.parameters.behaviour import behaviour, behaviour_parameters
from colibri.autopilot.parameters.number_paths import changed, described, has, named, read
from colibri.common.errors import unknown
from colibri.mavlink.parameters.numbers import Number, read_numbers
from colibri.mavlink.parameters.store import Parameter, Parameters, ParamType, Value
from colibri.plant.vehicle.description import MAX_ROTORS, Vehicle

__all__ = ["ImpossibleError", "Numbers", "behaviour", "definitions", "with_parameters"]

_FOLDER = Path(__file__).parent
DESCRIBED = {"lpv-mpc": read_numbers(_FOLDER / "lpv_mpc.csv")}  # numbers by control law
STRUCTURE = frozenset({"control_interval_s", "qp"})  # keys of any control law fixed in flight
_PREFIX_LENGTH = 3
_SPEED = "{speed}"  # placeholder for the unit of rotor speeds


class ImpossibleError(AutopilotError):
    """Values that contradict each other; the message names the key."""


class ChoiceError(AutopilotError):
    """A parameter is unknown, has an invalid value, or needs a ground station."""


def law_numbers(controller: str, table: Mapping[str, Any]) -> list[Number]:
    """Return a law's numbers; undescribed ones are named by their keys."""
    if controller in DESCRIBED:
        return [number for number in DESCRIBED[controller] if has(table, number.path)]
    letters = "".join(letter for letter in controller.upper() if letter.isascii() and letter.isalnum())
    start = letters.lstrip("0123456789") or "LAW"
    return named(start[:_PREFIX_LENGTH], table, STRUCTURE)


def vehicle_numbers(tree: Mapping[str, Any]) -> list[Number]:
    """Return the numbers that a vehicle models, in its unit of rotor speeds."""
    speed = tree["rotors"]["speed_unit"]
    inside = f"({speed})" if "/" in speed else speed
    return [
        number._replace(unit=speed if number.unit == _SPEED else number.unit.replace(_SPEED, inside))
        for number in _VEHICLE
        if has(tree, number.path)
    ]


def _each_rotor(line: Number) -> list[Number]:
    """Return a line for each rotor, where its path has `{n}`."""
    if "{n}" not in line.path:
        return [line]
    return [
        line._replace(
            name=line.name.format(n=rotor + 1),
            path=tuple(rotor if key == "{n}" else key for key in line.path),
            description=line.description.format(n=rotor + 1),
        )
        for rotor in range(MAX_ROTORS)
    ]


_VEHICLE = [number for line in read_numbers(_FOLDER / "vehicle.csv") for number in _each_rotor(line)]


class Numbers:
    def __init__(self, profile: Profile, vehicle: Vehicle) -> None:
        self._profile = profile = profile.of(vehicle)
        self._vehicle = vehicle
        self._table = profile.table(profile.controller)
        self._tree: dict[str, Any] = msgspec.to_builtins(vehicle)
        self._law = law_numbers(profile.controller, self._table)
        self._model = vehicle_numbers(self._tree)
        name, keys = profile.controller, f"controllers.{profile.controller}"
        self.definitions = [
            number.parameter(_default(number, tree), group, details.replace("{}", described(number.path)))
            for numbers, tree, group, details in (
                (self._law, self._table, f"Control law {name}", f"Profile key {keys}.{{}}."),
                (self._model, self._tree, "Vehicle model", "Vehicle key {}, autopilot only."),
            )
            for number in numbers
        ]
        self.defaults = {parameter.name: parameter.default for parameter in self.definitions}

    def of_vehicle(self, system_id: int = 1) -> list[Parameter]:
        """Return all parameters of a vehicle."""
        return [*self.definitions, *behaviour_parameters(system_id), *failsafe_parameters()]

    def applied(self, values: Mapping[str, Value]) -> tuple[Profile, Vehicle]:
        """Return profile and vehicle with these values, or raise ImpossibleError."""
        profile, vehicle = self._profile, self._vehicle
        table = changed(self._table, self._law, values, self.defaults)
        if table is not self._table:
            controllers = {**profile.controllers, table_of(profile.controller): table}
            profile = msgspec.structs.replace(profile, controllers=controllers)
        tree = changed(self._tree, self._model, values, self.defaults)
        return profile, vehicle if tree is self._tree else _vehicle(tree)


def definitions(profile: Profile, vehicle: Vehicle, system_id: int = 1) -> list[Parameter]:
    return Numbers(profile, vehicle).of_vehicle(system_id)


def _vehicle(tree: dict[str, Any]) -> Vehicle:
    try:
        return msgspec.convert(tree, type=Vehicle)
    except (msgspec.ValidationError, ArithmeticError) as reason:
        raise ImpossibleError(str(reason)) from reason


def _default(number: Number, tree: Mapping[str, Any]) -> Value:
    value: Value = read(tree, number.path)
    return value if isinstance(value, int) else value / number.scale


def with_parameters(
    profile: Profile, vehicle: Vehicle, values: Mapping[str, Value], *, served: bool
) -> tuple[Profile, Vehicle]:
    """Return the profile and the autopilot's vehicle with these parameters, or raise ChoiceError or ImpossibleError."""
    numbers = Numbers(profile, vehicle)
    known = {each.name: each for each in numbers.of_vehicle()}
    for name, value in values.items():
        if name not in known:
            raise ChoiceError(unknown("parameter", name, known))
        each = known[name]
        whole = each.kind == ParamType.INT
        if not each.minimum <= value <= each.maximum or (whole and value != int(value)):
            kind = "a whole number" if whole else "a number"
            raise ChoiceError(f"{name}: must be {kind} from {each.minimum:g} to {each.maximum:g}, not {value!r}")
        if not served and name not in numbers.defaults:
            raise ChoiceError(
                f"{name}: acts with ground stations only: give --gcs, or fly colibri sitl or the fixture sitl"
            )
    parameters = Parameters([*known.values()])
    whole_names = {name for name, each in known.items() if each.kind == ParamType.INT}
    parameters.load({name: int(value) if name in whole_names else value for name, value in values.items()})
    return numbers.applied(parameters.values)
