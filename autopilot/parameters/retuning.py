"""Retuning: the control law is rebuilt and checked before a change."""

from collections.abc import Callable, Collection, Mapping
from math import pi
from typing import Any, NamedTuple, Protocol, TypeAlias

import numpy as np

from colibri.autopilot.control.interface import (
    AT_REST,
    AttitudeController,
    AttitudeDemand,
    Clock,
    Controller,
    PathController,
    Preview,
    still_horizon,
)
from colibri.autopilot.control.profile import Profile
from colibri.autopilot.control.registry import check_controller, check_rotor_speeds, in_words, load_controller
from colibri.autopilot.parameters.definitions import ImpossibleError, Numbers
from colibri.mavlink.node.budget import Budget
from colibri.mavlink.parameters.store import ParamError, Parameters, Prepared, Value
from colibri.plant.vehicle.description import Vehicle

_LAW_US, _SLICE_US, _VALUES_US = 6000.0, 4000.0, 300.0
"""Work to build and try a control law, for a slice of a vehicle's trial, and to try other parameters."""
Build: TypeAlias = Callable[[Profile, Vehicle], Controller[Any]]
_TRIED = (
    AT_REST,
    AT_REST._replace(position_enu_m=(1.0, 1.0, 1.0)),
    AT_REST._replace(velocity_enu_m_s=(12.0, 0.0, -3.0), rate_flu_rad_s=(1.0, -1.0, 1.0)),
    AT_REST._replace(attitude=(0.0, 1.0, 0.0, 0.0), euler=(pi, 0.0, 0.0)),
)
"""Hover, a metre away, fast, upside down."""


class Rhythm(Protocol):
    """Parts of a control law that are fixed in flight."""

    control_interval_us: int
    preview: Preview


class ParameterTrial(Protocol):
    """Other objects built from parameters; methods raise on bad values."""

    def is_ready(self, vehicle: Vehicle) -> bool: ...

    def try_vehicle(self, vehicle: Vehicle) -> None: ...

    def try_values(self, parameters: Parameters) -> None: ...


class Tuned(NamedTuple):
    profile: Profile
    vehicle: Vehicle
    controller: Controller[Any]


class Retuning:
    """Rejects changes with which the control law cannot be built, without the rotor `lost`, or fly."""

    def __init__(
        self,
        numbers: Numbers,
        build: Build,
        running: Rhythm,
        say: Callable[[str], None],
        parameters: Parameters | None = None,
        trial: ParameterTrial | None = None,
        budget: Budget | None = None,
    ) -> None:
        self._numbers = numbers
        self._build = build
        self._say = say
        self._rhythm = _rhythm(running)
        self._parameters, self._trial, self._budget = parameters, trial, budget or Budget()
        self._tried: Vehicle | None = None
        self.lost: int | None = None

    def prepare(self, names: Collection[str], values: Mapping[str, Value]) -> Prepared | ParamError:
        """Return the changed control law as a `Tuned`, or a refusal."""
        changed = ", ".join(names) if len(names) == 1 else ""
        try:
            if any(name not in self._numbers.defaults for name in names):
                self._budget.spend(_VALUES_US)
                self._try_values(values)
            if all(name not in self._numbers.defaults for name in names):
                return Prepared()
            self._budget.spend(_LAW_US)
            tuned = self.tuned(values)
            if _rhythm(tuned.controller) == self._rhythm:
                return Prepared(tuned)
        except Exception as error:  # whatever somebody else's law raises, the flight goes on with the old one
            return self._refused(changed, in_words(error), ParamError.VALUE_OUT_OF_RANGE)
        return self._refused(changed, "the law's sample and preview stay in flight", ParamError.PERMISSION_DENIED)

    def is_ready(self, names: Collection[str], values: Mapping[str, Value]) -> bool:
        """Whether `prepare` may be called; if not, do a slice of its work."""
        if self._trial is None or all(name not in self._numbers.defaults for name in names):
            return True
        try:
            ready = self._trial.is_ready(self._numbers.applied(values)[1])
        except Exception:  # of somebody else's law; `prepare` meets it again, and reports it
            return True
        if not ready:
            self._budget.spend(_SLICE_US)
        return ready

    def _refused(self, changed: str, reason: str, refusal: ParamError) -> ParamError:
        if changed:
            self._say(f"{changed} not changed: {reason}")
        return refusal

    def tuned(self, values: Mapping[str, Value]) -> Tuned:
        profile, vehicle, controller = self.built(values)
        _try(profile.controller, controller, vehicle)
        if self._trial is not None and vehicle != self._tried:
            self._trial.try_vehicle(vehicle)
            self._tried = vehicle
        return Tuned(profile, vehicle, controller)

    def built(self, values: Mapping[str, Value]) -> Tuned:
        """Build the control law, without the lost rotor."""
        profile, vehicle = self._numbers.applied(values)
        vehicle = vehicle if self.lost is None else vehicle.without_rotor(self.lost)
        return Tuned(profile, vehicle, self._build(profile, vehicle))

    def try_all(self, values: Mapping[str, Value]) -> None:
        try:
            self._try_values(values)
            self.tuned(values)
        except Exception as error:
            raise ImpossibleError(in_words(error)) from error

    def _try_values(self, values: Mapping[str, Value]) -> None:
        if self._trial is not None and self._parameters is not None:
            self._trial.try_values(self._parameters.trial(values))


def builder(controller: str, clock: Clock) -> Build:
    factory = load_controller(controller)

    def build(profile: Profile, vehicle: Vehicle) -> Controller[Any]:
        law = factory(profile.table(controller), vehicle, clock)
        check_controller(controller, law)
        return law

    return build


def _rhythm(controller: Rhythm) -> tuple[int, Preview]:
    return controller.control_interval_us, controller.preview


def _try(name: str, controller: Controller[Any], vehicle: Vehicle) -> None:
    """Fly four control samples; by attitude and on the path, too, if the law can."""
    references = still_horizon(controller.preview.samples)
    memory, speeds = controller.initial(vehicle.hover_speed), (vehicle.hover_speed,) * vehicle.rotors.count
    states = [state._replace(rotor_speeds=speeds) for state in _TRIED]
    hover = states[0]
    for sample, state in enumerate(states):
        memory, decision = controller.step(memory, sample * controller.control_interval_us, state, references)
        check_rotor_speeds(name, decision.rotor_speeds, vehicle.rotors)
    if isinstance(controller, AttitudeController):
        thrust_n = np.full(controller.preview.samples, vehicle.body.mass_kg * vehicle.gravity_m_s2)
        time_us = len(_TRIED) * controller.control_interval_us
        level = AttitudeDemand(references.position_enu_m, references.velocity_enu_m_s, thrust_n)
        _, decision = controller.step_attitude(memory, time_us, hover, level)
        check_rotor_speeds(name, decision.rotor_speeds, vehicle.rotors)
    if isinstance(controller, PathController) and controller.min_path_speed < 1.0:
        for sample in range(2):  # the second with a plan
            time_us = sample * controller.control_interval_us
            memory, decision = controller.step_on_path(memory, time_us, hover, references)
            check_rotor_speeds(name, decision.rotor_speeds, vehicle.rotors)
