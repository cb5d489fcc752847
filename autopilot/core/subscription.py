"""Subscribers of the parameters: parts that adopt each change."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import partial
from typing import Any

from colibri.autopilot.control.interface import Controller
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.parameters.behaviour import behaviour
from colibri.autopilot.parameters.retuning import Tuned
from colibri.mavlink.parameters.store import Parameters, Value
from colibri.plant.vehicle.description import Vehicle


class Subscribers:
    """Callbacks that adopt a change of parameters; control law and vehicle only if one of their numbers has changed.

    The active parameters, control law and vehicle are `values` and `tuned`.
    """

    def __init__(
        self,
        *,
        parameters: tuple[Callable[[Parameters], None], ...],
        behaviour: tuple[Callable[[Behaviour], None], ...],
        law: tuple[Callable[[Controller[Any], Vehicle], None], ...],
        vehicle: tuple[Callable[[Vehicle], None], ...],
        values: Mapping[str, Value],
        tuned: Tuned,
    ) -> None:
        self._parameters, self._behaviour, self._law, self._vehicle = parameters, behaviour, law, vehicle
        self._values, self._tuned = values, tuned
        self.revision = 0  # of the adopted parameters

    def adopt(self, parameters: Parameters) -> None:
        if parameters.revision == self.revision:
            return
        self.revision, made = parameters.revision, parameters.take_made()
        tuned = made if isinstance(made, Tuned) else None
        for call in self._calls(parameters, tuned):
            call()
        self._values, self._tuned = parameters.values, tuned or self._tuned

    def fly(self, tuned: Tuned) -> None:
        """Adopt another control law and vehicle with the same parameters."""
        for call in self._calls_of(tuned):
            call()
        self._tuned = tuned

    def keep(self, parameters: Parameters) -> None:
        """Return to the settings before a change that a subscriber refused."""
        parameters.load(self._values)
        parameters.take_made()
        self.revision = parameters.revision
        calls = list[Callable[[], None]]()
        with suppress(Exception):  # what has raised may raise again, and has adopted nothing
            calls += self._calls(parameters, self._tuned)
        for call in calls:
            with suppress(Exception):
                call()

    def _calls(self, parameters: Parameters, tuned: Tuned | None) -> Iterator[Callable[[], None]]:
        yield from (partial(adopt, parameters) for adopt in self._parameters)
        flies_by = behaviour(parameters)
        yield from (partial(adopt, flies_by) for adopt in self._behaviour)
        if tuned is not None:
            yield from self._calls_of(tuned)

    def _calls_of(self, tuned: Tuned) -> Iterator[Callable[[], None]]:
        yield from (partial(adopt, tuned.controller, tuned.vehicle) for adopt in self._law)
        yield from (partial(adopt, tuned.vehicle) for adopt in self._vehicle)
