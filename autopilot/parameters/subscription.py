"""Who goes by the parameters: each part is subscribed once, and is handed every change."""

from collections.abc import Callable
from typing import Any, NamedTuple

from colibri.autopilot.control.interface import Controller
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.parameters.behaviour import behaviour
from colibri.autopilot.parameters.retuning import Tuned
from colibri.mavlink.parameters.store import Parameters
from colibri.plant.vehicle.description import Vehicle


class Subscribers(NamedTuple):
    """What adopts a change, by what it goes by.

    Attributes:
        parameters: Go by parameters as they are.
        behaviour: Go by the numbers of the behaviour.
        law: Fly by the control law and its vehicle; only called where one of their numbers has changed.
        vehicle: Go by the vehicle; likewise.
    """

    parameters: tuple[Callable[[Parameters], None], ...]
    behaviour: tuple[Callable[[Behaviour], None], ...]
    law: tuple[Callable[[Controller[Any], Vehicle], None], ...]
    vehicle: tuple[Callable[[Vehicle], None], ...]

    def adopt(self, parameters: Parameters) -> None:
        """Hand out what has changed since this was last called, if anything has."""
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
