"""All parameters of the autopilot: control law, vehicle model, behaviour, failsafes."""

from collections.abc import Mapping
from typing import Any

import msgspec

from colibri.autopilot.commander.rules.failsafe_parameters import failsafe_parameters
from colibri.autopilot.control.law_files import table_of
from colibri.autopilot.control.profile import Profile
from colibri.autopilot.errors import AutopilotError
from colibri.autopilot.parameters.behaviour import behaviour, behaviour_parameters
from colibri.autopilot.parameters.control_law import law_numbers
from colibri.autopilot.parameters.number_paths import changed, described
from colibri.autopilot.parameters.vehicle_model import vehicle_numbers
from colibri.mavlink.parameters.store import Parameter, Value
from colibri.plant.vehicle.description import Vehicle

__all__ = ["ImpossibleError", "Numbers", "behaviour", "definitions"]


class ImpossibleError(AutopilotError):
    """Values that contradict each other; the message names the key."""


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
            number.parameter(self._table, f"Control law {name}", f"Profile key {keys}.{described(number.path)}.")
            for number in self._law
        ] + [
            number.parameter(self._tree, "Vehicle model", f"Vehicle key {described(number.path)}, autopilot only.")
            for number in self._model
        ]
        self.defaults = {parameter.name: parameter.default for parameter in self.definitions}

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
    return [*Numbers(profile, vehicle).definitions, *behaviour_parameters(system_id), *failsafe_parameters()]


def _vehicle(tree: dict[str, Any]) -> Vehicle:
    try:
        return msgspec.convert(tree, type=Vehicle)
    except (msgspec.ValidationError, ArithmeticError) as reason:
        raise ImpossibleError(str(reason)) from reason
