"""Retuning in flight: the control law is rebuilt, and checked, before one of its parameters changes."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Protocol, TypeAlias

import numpy as np

from colibri.autopilot.control.interface import Clock, Controller, Horizon, Preview, VehicleState
from colibri.autopilot.control.profile import Profile
from colibri.autopilot.control.registry import (
    check_controller,
    check_rotor_speeds,
    in_words,
    load_controller,
)
from colibri.autopilot.parameters.definitions import ImpossibleError, Numbers
from colibri.mavlink.parameters.store import ParamError, Prepared, Value
from colibri.plant.vehicle.description import Vehicle

Build: TypeAlias = Callable[[Profile, Vehicle], Controller[Any]]


class Rhythm(Protocol):
    """What a control law cannot change in flight: its sample, and the references that it takes."""

    control_interval_us: int
    preview: Preview


class Tuned(NamedTuple):
    """A control law with the numbers it was built from."""

    profile: Profile
    vehicle: Vehicle
    controller: Controller[Any]


class Tuning:
    """Checks each change before it is made: one by which no control law can be built, or fly, is refused."""

    def __init__(self, numbers: Numbers, build: Build, running: Rhythm, say: Callable[[str], None]) -> None:
        """Tune `numbers` while a law flies in the rhythm of `running`; `say` reports why a law refused them."""
        self._numbers = numbers
        self._build = build
        self._say = say
        self._rhythm = _rhythm(running)

    def prepare(self, name: str, values: Mapping[str, Value]) -> Prepared | ParamError:
        """Return the control law for a change as a `Tuned`, or why a parameter cannot change so; nothing is kept.

        For `colibri.mavlink.parameters.store.Parameters.prepare`; `values` are of all parameters, the new one in.
        """
        if name not in self._numbers.defaults:
            return Prepared()
        try:
            profile, vehicle = self._numbers.applied(values)
        except ImpossibleError:
            return ParamError.VALUE_OUT_OF_RANGE
        try:
            controller = self._build(profile, vehicle)
            _try(profile.controller, controller, vehicle)
        except Exception as error:  # whatever somebody else's law raises, the flight goes on with the old one
            self._say(f"{name} not changed: {in_words(error)}")
            return ParamError.VALUE_OUT_OF_RANGE
        if _rhythm(controller) != self._rhythm:
            return ParamError.PERMISSION_DENIED
        return Prepared(Tuned(profile, vehicle, controller))


def builder(controller: str, clock: Clock) -> Build:
    """Return what builds a control law again and again: to find it among what is installed takes longer than that.

    Raises:
        ControllerError: There is none of that name.
    """
    factory = load_controller(controller)

    def build(profile: Profile, vehicle: Vehicle) -> Controller[Any]:
        law = factory(profile.table(controller), vehicle, clock)
        check_controller(controller, law)
        return law

    return build


def _rhythm(controller: Rhythm) -> tuple[int, Preview]:
    """Return its rhythm as values to compare."""
    return controller.control_interval_us, controller.preview


def _try(name: str, controller: Controller[Any], vehicle: Vehicle) -> None:
    """Hover for two control samples, the second one a metre away from the reference.

    Raises:
        DecisionError: No rotor can follow what the law decides.
    """
    nothing = (0.0, 0.0, 0.0)
    still, straight = np.zeros((controller.preview.samples, 3)), np.zeros(controller.preview.samples)
    references = Horizon(still, still, still, still, still, straight, straight, straight)
    memory = controller.initial(vehicle.hover_speed)
    for sample, place in enumerate((nothing, (1.0, 1.0, 1.0))):
        state = VehicleState(place, nothing, (1.0, 0.0, 0.0, 0.0), nothing, nothing)
        memory, decision = controller.step(memory, sample * controller.control_interval_us, state, references)
        check_rotor_speeds(name, decision.rotor_speeds, vehicle.rotors.max_speed)
