"""Steps of a flight with their memory, state and references, for repetition."""

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import replace
from pickle import dumps
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from colibri.autopilot.control.interface import Clock, Controller, Decision, Horizon, VehicleState
from colibri.autopilot.control.registry import DecisionError, check_answer, in_words
from colibri.common.errors import Error, InFlightError
from colibri.common.types import Array
from colibri.conformance.subject import Subject
from colibri.flights.flight import Direct, SteppedFlight
from colibri.flights.in_process import put_together
from colibri.plant.vehicle.description import Vehicle

_STEPS = ("step", "step_on_path", "step_attitude")
_MEMBERS = (
    *("control_interval_us", "preview", "initial", *_STEPS),
    *("charge_ah", "with_charge", "mass_kg", "with_mass", "plan_columns", "warm_up"),
    *("min_path_speed", "path_speed", "lag_us", "with_lag"),
)
"""Members that the autopilot uses."""
_JUMP_M, _JUMP_RAD = 5.0, 4.0


class FlownStep(NamedTuple):
    """One step of a control law.

    Attributes:
        memory: The object itself; `pickled` before the step, if possible.
        references: A copy; `changed` if the law has modified its own.
        decision: The object itself, with a copy of its `rotor_speeds`.
    """

    method: str
    memory: Any
    pickled: bytes | None
    time_us: int
    state: VehicleState
    references: Horizon
    changed: bool
    decision: Decision
    rotor_speeds: Array
    took_s: float

    def again(self, law: Controller[Any], memory: Any) -> tuple[Any, Decision]:
        """Repeat the step by another law, or from another memory."""
        try:
            answer = getattr(law, self.method)(memory, self.time_us, self.state, copied(self.references))
        except SystemExit as error:
            raise DecisionError(f"raised {in_words(error)}") from error
        check_answer(type(law).__name__, answer, self.time_us)
        next_memory, decision = answer
        return next_memory, decision


class FlownSteps(NamedTuple):
    steps: list[FlownStep]
    failure: str
    raised: BaseException | None


class RecordingLaw:
    """A control law that records each step; it has the same members as the original."""

    def __init__(self, law: Controller[Any]) -> None:
        self.steps: list[FlownStep] = []
        for name in _MEMBERS:
            if hasattr(law, name):
                member = getattr(law, name)
                setattr(self, name, self._noted(name, member) if name in _STEPS else member)

    def _noted(self, method: str, take: Any) -> Any:
        def step(memory: Any, time_us: int, state: VehicleState, references: Horizon) -> Any:
            given, pickled = copied(references), pickled_or_none(memory)
            began_s = perf_counter()
            answer = take(memory, time_us, state, references)
            took_s = perf_counter() - began_s
            if isinstance(answer, tuple) and len(answer) == 2 and isinstance(answer[1], Decision):
                changed = any(not np.array_equal(a, b) for a, b in zip(given, references, strict=True))
                speeds = np.array(answer[1].rotor_speeds)
                noted = FlownStep(method, memory, pickled, time_us, state, given, changed, answer[1], speeds, took_s)
                self.steps.append(noted)
            return answer

        return step


def fly_for_steps(subject: Subject, track: str, **options: Any) -> FlownSteps:
    """Fly until the flight ends or the law fails."""
    recorders: list[RecordingLaw] = []

    def law(table: Mapping[str, Any], vehicle: Vehicle, clock: Clock) -> Controller[Any]:
        recorders.append(RecordingLaw(subject.law(table, vehicle, clock)))
        recorded: Any = recorders[-1]
        return recorded  # type: ignore[no-any-return]

    plan = subject.plan(track, **options)
    plan = replace(plan, spec=replace(plan.spec, controller=law))
    try:
        autopilot, plant = put_together(plan, perf_counter)
    except Error:
        raise
    except Exception as error:  # of its warm_up
        return FlownSteps([], in_words(error), error)
    try:
        for _ in SteppedFlight(plant, autopilot, Direct()).samples(plan.spec.duration):
            pass
    except DecisionError as error:
        return FlownSteps(recorders[0].steps, str(error), error)
    except InFlightError:  # the vehicle has left the range of the plant's model
        pass
    return FlownSteps(recorders[0].steps, "", None)


def flown_steps(
    track: str, *, controller: Any, profile: Any = None, vehicle: Any = None, seed: int = 0, **options: Any
) -> tuple[Controller[Any], list[FlownStep]]:
    """Fly a control law with options of `colibri.fly`; return the law, rebuilt, and its steps."""
    subject = Subject.of(controller, profile, vehicle, seed)
    flown = fly_for_steps(subject, track, **options)
    if flown.raised is not None:
        raise flown.raised
    return subject.build(), flown.steps


def copied(references: Horizon) -> Horizon:
    return Horizon(*(np.array(column) for column in references))


def pickled_or_none(memory: Any) -> bytes | None:
    try:
        return dumps(memory)
    except Exception:  # its own `__reduce__` may raise anything
        return None


def own_copy(memory: Any) -> Any:
    try:
        return deepcopy(memory)
    except Exception:  # its own `__deepcopy__` may raise anything; the check of the pickle reports it
        return memory


def jumped(step: FlownStep, seed: int) -> FlownStep:
    """Make the references jump from a random one on, and invert `airborne`."""
    rng = np.random.default_rng(seed)
    references = copied(step.references)
    since = int(rng.integers(len(references.yaw_rad)))
    references.position_enu_m[since:] += rng.normal(scale=_JUMP_M, size=3)
    references.velocity_enu_m_s[since:] += rng.normal(scale=_JUMP_M, size=3)
    references.acceleration_enu_m_s2[since:] += rng.normal(scale=_JUMP_M, size=3)
    references.yaw_rad[since:] += rng.normal(scale=_JUMP_RAD)
    return step._replace(references=references, state=step.state._replace(airborne=not step.state.airborne))
