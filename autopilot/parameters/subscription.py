"""Subscribers of the parameters: parts that adopt each change."""

from collections.abc import Callable
from typing import Any, NamedTuple

from colibri.autopilot.control.interface import Controller
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.parameters.behaviour import behaviour
from colibri.autopilot.parameters.retuning import Tuned
from colibri.mavlink.parameters.store import Parameters
from colibri.plant.vehicle.description import Vehicle


class Subscribers(NamedTuple):
    """Callbacks that adopt a change, by what they take.

    Attributes:
        parameters: Take all parameters.
        behaviour: Take the numbers of the behaviour.
        law: Take the control law and its vehicle; called only if one of their numbers has changed.
        vehicle: Take the vehicle; likewise.
    """

    parameters: tuple[Callable[[Parameters], None], ...]
    behaviour: tuple[Callable[[Behaviour], None], ...]
    law: tuple[Callable[[Controller[Any], Vehicle], None], ...]
    vehicle: tuple[Callable[[Vehicle], None], ...]

    def adopt(self, parameters: Parameters) -> None:
        """Call back with the changes since the last call, if there are any."""
        changes = parameters.take_changes()
        if changes is None:
            return
        for adopt_parameters in self.parameters:
            adopt_parameters(parameters)
        flies_by = behaviour(parameters)
        for adopt_behaviour in self.behaviour:
            adopt_behaviour(flies_by)
        if isinstance(changes.made, Tuned):
            for adopt_law in self.law:
                adopt_law(changes.made.controller, changes.made.vehicle)
            for adopt_vehicle in self.vehicle:
                adopt_vehicle(changes.made.vehicle)
