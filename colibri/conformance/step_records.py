"""Steps of a flight for repetition, and checks in flight: hover, tracks, wind, time."""

from collections.abc import Iterator, Mapping
from copy import deepcopy
from dataclasses import replace
from pickle import dumps
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from colibri.analysis.outcome import fly_to_its_end
from colibri.analysis.report import Report
from colibri.autopilot.control.interface import Clock, Controller, Decision, Horizon, VehicleState
from colibri.autopilot.control.registry import DecisionError, check_answer, in_words
from colibri.autopilot.guidance.trajectories.tracks import THESIS_TRACKS
from colibri.common.errors import Error, InFlightError
from colibri.common.types import Array
from colibri.conformance.subject import Result, Row, Subject, judged, not_applicable
from colibri.flights.flight import Direct, SteppedFlight
from colibri.flights.in_process import put_together
from colibri.flights.spec import Window
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
    """One step of a control law."""

    method: str
    memory: Any  # the object itself; `pickled` before the step, if possible
    pickled: bytes | None
    time_us: int
    state: VehicleState
    references: Horizon  # a copy; `changed` if the law has modified its own
    changed: bool
    decision: Decision  # the object itself; `rotor_speeds` is a copy
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
    """A law that records each step, with the original's members."""

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
    """Fly with options of `colibri.fly`; return the law, rebuilt, and its steps."""
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


_HOVER_S, _MAX_DRIFT_M = 8.0, 0.5  # permitted drift in calm air, from rest on the point
_WIND, _WIND_S = "5@270", 12.0
_TIMED_S, _TIMED, _UNTIMED = 4.0, 200, 5  # duration and least number of timed steps, without the first few


def flight_checks(subject: Subject) -> Iterator[Row]:
    yield _hover(subject)
    for track in THESIS_TRACKS:
        yield _flown(subject, track, f"{track}, {subject.duration_s:g} s", duration=subject.duration_s)
    if subject.vehicle.drag is None:
        yield not_applicable("hover in wind of 5 m/s", f"{subject.vehicle.name} has no drag")
    else:
        yield _flown(
            subject,
            "hover",
            "hover in wind of 5 m/s, turbulence",
            wind=_WIND,
            turbulence="light",
            start=subject.start(),
            duration=_WIND_S,
        )


def time_checks(subject: Subject) -> Iterator[Row]:
    """Yield times of steps: figures, as they vary between runs."""
    interval_us = subject.build().control_interval_us
    seconds = max(_TIMED_S, _TIMED * interval_us * 1e-6)
    steps = fly_for_steps(subject, "lemniscate:lap=20", duration=seconds).steps[_UNTIMED:]
    if not steps:
        yield not_applicable("a step", "it took too few")
        return
    p50_us, p99_us = np.percentile([1e6 * step.took_s for step in steps], (50, 99))
    part = p99_us / interval_us
    found = f"p50 {p50_us:.0f} µs, p99 {p99_us:.0f} µs: {part:.2g} of its {interval_us / 1000:g} ms"
    yield Row("", f"{len(steps)} steps", Result.FIGURE, found)


def _hover(subject: Subject) -> Row:
    options = {"start": subject.start(), "duration": _HOVER_S}
    lost, report = fly(subject, "hover", **options)
    furthest_m = report["max_error_m"] if report else np.nan
    drifts = f"{furthest_m:.2f} m off its point: expected at most {_MAX_DRIFT_M:g} m"
    failure = lost or (drifts if not furthest_m <= _MAX_DRIFT_M else "")
    found = f"at most {_length(furthest_m)} off"
    return judged(f"hover held, {_HOVER_S:g} s", failure, found, subject.command("hover", **options))


def _flown(subject: Subject, track: str, tried: str, **options: Any) -> Row:
    lost, report = fly(subject, track, **options)
    rms_m = report["rmse_in_window_m"] if report and not lost else np.nan
    found = f"RMS {_length(rms_m)} after {options['duration'] * 2.0 / 3.0:.3g} s"
    return judged(tried, lost, found, subject.command(track, **options))


def fly(subject: Subject, track: str, **options: Any) -> tuple[str, Report | None]:
    """Return the reason of a loss, and the report, whose window is the last third."""
    window = Window(options["duration"] * 2.0 / 3.0, options["duration"])
    try:
        outcome = fly_to_its_end(subject.plan(track, window=window, **options))
    except Exception as error:
        return in_words(error), None
    return outcome.lost, outcome.report


def _length(metres: float) -> str:
    return f"{1000.0 * metres:.3g} mm" if metres < 1.0 else f"{metres:.3g} m"
