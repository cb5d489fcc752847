"""Checks of the optional protocols, and of explicit memory: equal inputs give equal outputs, bit for bit."""

from collections.abc import Callable, Iterator
from itertools import zip_longest
from math import acos, degrees, isfinite, radians
from pickle import dumps, loads
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from colibri.autopilot.control.interface import AttitudeDemand
from colibri.autopilot.control.registry import in_words
from colibri.common.rotations import quaternion_from_euler, rotation_matrix
from colibri.common.serialization import to_bytes
from colibri.common.types import Array
from colibri.conformance import interface_checks as interface
from colibri.conformance.interface_checks import Protocol, has, out_of_limits
from colibri.conformance.loop_flight import HELD_S, hold
from colibri.conformance.step_records import FlownStep, fly_for_steps, own_copy
from colibri.conformance.subject import Result, Row, Subject, judged, not_applicable

_TRACK = "hover:height=3"
_S, _SAMPLES = 0.3, 4
_CLOSE = 1e-9
_MAX_TILT_DEG = 10.0  # largest error of a held attitude

_DEMAND = "AttitudeDemand(np.tile({0!r}, (n, 1)), np.zeros((n, 3)), np.full(n, {1!r}))"

Examine: TypeAlias = Callable[[Subject, Any, list[FlownStep]], tuple[str, str]]
"""Returns a failure, and Python code that shows it."""


def optional_checks(subject: Subject) -> Iterator[Row]:
    law = subject.build()
    options = {"start": subject.start(x=0.3, z=3.0), "duration": max(_S, _SAMPLES * law.control_interval_us * 1e-6)}
    steps = fly_for_steps(subject, _TRACK, **options).steps
    for protocol, examine in _EXAMINED.items():
        tried = f"{protocol.members[0]}: {protocol.what}"
        if not has(law, protocol):
            yield not_applicable(tried, "the law has none")
        elif not steps:
            yield not_applicable(tried, "it took no step")
        else:
            failure, code = examine(subject, law, steps)
            yield judged(tried, failure, "consistent", subject.snippet(code, _TRACK, **options))


def _charge(subject: Subject, law: Any, steps: list[FlownStep]) -> str:
    battery = subject.vehicle.battery
    full_ah = battery.capacity_ah if battery else 2.0
    return _kept(subject, law, steps, "charge_ah", "with_charge", [0.0, 0.25 * full_ah, 0.75 * full_ah])


def _mass(subject: Subject, law: Any, steps: list[FlownStep]) -> str:
    mass_kg = subject.vehicle.body.mass_kg
    return _kept(subject, law, steps, "mass_kg", "with_mass", [mass_kg, 0.95 * mass_kg, 1.05 * mass_kg])


def _kept(subject: Subject, law: Any, steps: list[FlownStep], get: str, put: str, values: list[float]) -> str:
    step = steps[-1]
    before = getattr(law, get)(step.memory)
    if not isinstance(before, int | float) or not isfinite(before) or before < 0.0:
        return f"{get} gave {before!r}: expected a number from 0 on"
    for value in values:
        memory = getattr(law, put)(step.memory, value)
        after = getattr(law, get)(memory)
        if abs(after - value) > _CLOSE * (1.0 + abs(value)):
            return f"{get} gave {after!r} after {put}(memory, {value!r})"
        if getattr(law, get)(step.memory) != before:
            return f"{put} has changed the memory that it was given"
        wrong = out_of_limits(subject, step.again(law, memory)[1])
        if wrong:
            return f"after {put}(memory, {value!r}): {wrong}"
    return ""


def _path(subject: Subject, law: Any, steps: list[FlownStep]) -> str:
    if not 0.0 < law.min_path_speed <= 1.0:
        return f"min_path_speed is {law.min_path_speed!r}: expected above 0, up to 1"
    step = steps[-1]._replace(method="step_on_path")
    for lag_us in (0, 40_000, 2_000_000):
        memory = law.with_lag(step.memory, lag_us)
        if law.lag_us(memory) != lag_us:
            return f"lag_us gave {law.lag_us(memory)!r} after with_lag(memory, {lag_us})"
        if law.min_path_speed == 1.0:
            continue
        after, decision = step.again(law, memory)
        wrong = out_of_limits(subject, decision)
        speed, lag_after_us = law.path_speed(after), law.lag_us(after)
        if wrong:
            return f"step_on_path: {wrong}"
        if not isfinite(speed) or speed < law.min_path_speed - _CLOSE:
            return f"path_speed gave {speed!r}: expected from {law.min_path_speed:g} on"
        if not isinstance(lag_after_us, int) or lag_after_us < 0:
            return f"lag_us gave {lag_after_us!r}: expected whole µs from 0 on"
    after, _ = steps[-1]._replace(method="step").again(law, law.with_lag(step.memory, 0))
    if (law.path_speed(after), law.lag_us(after)) != (1.0, 0):
        return f"step is to keep to the clock: path_speed {law.path_speed(after)!r}, lag_us {law.lag_us(after)!r}"
    return ""


def _plan(subject: Subject, law: Any, steps: list[FlownStep]) -> str:
    for step in steps:
        how, columns = step.decision.diagnostics, law.plan_columns
        if how.predicted is None and how.planned_squared is None:
            continue
        if how.predicted is None or how.planned_squared is None:
            return "diagnostics has one of predicted and planned_squared: a plan is shown by both"
        if how.predicted.ndim != 2 or not all(0 <= column < how.predicted.shape[1] for column in columns):
            return f"plan_columns {tuple(columns)} are not in predicted of shape {how.predicted.shape}"
        if how.planned_squared.shape != (len(how.predicted) - 1, subject.vehicle.rotors.count):
            return f"planned_squared of shape {how.planned_squared.shape} beside predicted {how.predicted.shape}"
        off = np.array([how.predicted[0, column] for column in columns[:3]]) - step.state.euler
        off[2] = (off[2] + np.pi) % (2.0 * np.pi) - np.pi
        if np.abs(off).max() > radians(_MAX_TILT_DEG):
            return f"the plan begins {degrees(np.abs(off).max()):.0f}° off the attitude that the step was given"
        return ""
    return "no step of a flight in hover has a plan: predicted and planned_squared"


def _attitude(subject: Subject, law: Any, steps: list[FlownStep]) -> tuple[str, str]:
    rng, n = np.random.default_rng(subject.seed), law.preview.samples
    weight_n = subject.vehicle.body.mass_kg * subject.vehicle.gravity_m_s2
    memory = steps[0].memory
    for at, step in enumerate(steps):
        angles, thrust_n = rng.uniform(-0.8, 0.8, 3).round(3).tolist(), round(rng.uniform(-0.5, 3.0) * weight_n, 3)
        demand = AttitudeDemand(np.tile(angles, (n, 1)), np.zeros((n, 3)), np.full(n, thrust_n))
        try:
            memory, decision = law.step_attitude(memory, step.time_us, step.state, demand)
            wrong = out_of_limits(subject, decision)
            memory, decision = step.again(law, memory)
            wrong = wrong or out_of_limits(subject, decision)
        except Exception as error:
            wrong = in_words(error)
        if wrong:
            code = (
                f"from colibri import AttitudeDemand; import numpy as np; a, n = s[{at}], law.preview.samples; "
                f"m, d = law.step_attitude(a.memory, a.time_us, a.state, {_DEMAND.format(tuple(angles), thrust_n)}); "
                "print(d, a.again(law, m)[1])"
            )
            return wrong, code
    for phi, theta in ((0.0, 0.0), (0.3, -0.2)):
        wrong = _not_held(subject, phi, theta, weight_n)
        if wrong:
            arguments = f"{phi}, {theta}, thrust_n={weight_n!r}, {subject.of_law}"
            return wrong, f"from colibri.conformance import held; print(held({arguments}))"
    return "", ""


def _not_held(subject: Subject, phi: float, theta: float, thrust_n: float) -> str:
    try:
        state = hold(subject, phi, theta, thrust_n)
    except Exception as error:
        return in_words(error)
    off_deg = degrees(acos(max(-1.0, min(1.0, float(_axis(*state.euler) @ _axis(phi, theta, state.euler[2]))))))
    if off_deg <= _MAX_TILT_DEG:
        return ""
    return f"told roll {phi:g}, pitch {theta:g} rad it is {off_deg:.0f}° off after {HELD_S:g} s"


def _axis(phi: float, theta: float, psi: float) -> Any:
    """Return the body's z axis in ENU, (3,)."""
    return np.array(rotation_matrix(quaternion_from_euler(phi, theta, psi)))[:, 2]


def _compiled(subject: Subject, _: Any, steps: list[FlownStep]) -> str:
    late: Any = subject.build()
    for at, step in enumerate(steps):
        decision = step.again(late, step.memory)[1]
        if at == len(steps) // 2:
            late.warm_up()
            late.warm_up()
        if decision.rotor_speeds.tobytes() != step.rotor_speeds.tobytes():
            return f"step {at} is decided otherwise where warm_up is called later"
    return ""


def _with(examine: Callable[[Subject, Any, list[FlownStep]], str], code: str) -> Examine:
    def examined(subject: Subject, law: Any, steps: list[FlownStep]) -> tuple[str, str]:
        try:
            return examine(subject, law, steps), code
        except Exception as error:
            return in_words(error), code

    return examined


_EXAMINED: dict[Protocol, Examine] = {
    interface.ATTITUDE: _attitude,
    interface.CHARGE: _with(
        _charge, "m = s[-1].memory; print(law.charge_ah(m), law.charge_ah(law.with_charge(m, 0.5)))"
    ),
    interface.MASS: _with(_mass, "m = s[-1].memory; print(law.mass_kg(m), law.mass_kg(law.with_mass(m, 0.7)))"),
    interface.PATH: _with(
        _path,
        "a = s[-1]; m = law.with_lag(a.memory, 40_000); print(law.lag_us(m), law.path_speed(m)); "
        "print(a._replace(method='step_on_path').again(law, m))",
    ),
    interface.PLAN: _with(_plan, "print(law.plan_columns, s[-1].decision.diagnostics)"),
    interface.COMPILED: _with(
        _compiled,
        "a = s[0]; b = a.again(law, a.memory)[1].rotor_speeds.tolist(); law.warm_up(); "
        "print(b, a.again(law, a.memory)[1].rotor_speeds.tolist())",
    ),
}


_LAP, _OTHER = "lemniscate:lap=10,height=5", "hover:height=3"
_MEMORY_S, _MEMORY_SAMPLES = 0.6, 8  # duration, and least number of samples

Taken: TypeAlias = Iterator[tuple[int, Array, Array]]
"""Number of a step, and its original and repeated rotor speeds."""


class RepeatedSteps(NamedTuple):
    """A way to repeat steps; `code` shows a difference at step {k}."""

    tried: str
    take: Callable[[Subject, list[FlownStep], list[FlownStep]], Taken]
    code: str


def memory_checks(subject: Subject) -> Iterator[Row]:
    seconds = max(_MEMORY_S, _MEMORY_SAMPLES * subject.build().control_interval_us * 1e-6)
    options = {"start": subject.start(x=0.5, z=5.0), "duration": seconds}
    steps = fly_for_steps(subject, _LAP, **options).steps
    others = fly_for_steps(subject, _OTHER, start=subject.start(phi=20.0, vx=1.0), duration=seconds).steps
    if not steps or not others:
        yield not_applicable("steps taken again", "it took no step")
        return
    count = f"{len(steps)} steps"
    for trial in _TRIALS:
        at, failure = _difference(trial.take(subject, steps, others))
        yield judged(trial.tried, failure, count, subject.snippet(trial.code.format(k=at), _LAP, **options))
    changed = [k for k, step in enumerate(steps) if step.changed]
    failure = f"it writes to them, at step {changed[0]} first" if changed else ""
    see = subject.snippet("print([k for k, a in enumerate(s) if a.changed])", _LAP, **options)
    yield judged("references left as they are", failure, count, see)
    now = (np.array(step.decision.rotor_speeds) for step in steps)
    late = any(step.rotor_speeds.tobytes() != speeds.tobytes() for step, speeds in zip(steps, now, strict=True))
    failure = "it overwrites the rotor speeds that it has returned: return a new array" if late else ""
    see = subject.snippet("print(s[0].rotor_speeds.tolist(), s[0].decision.rotor_speeds.tolist())", _LAP, **options)
    yield judged("decisions left as they were", failure, count, see)
    yield _plain(steps)


def _difference(taken: Taken) -> tuple[int, str]:
    at = -1
    try:
        for at, before, after in taken:
            if before.tobytes() != after.tobytes():
                by = float(np.abs(after - before).max())
                speeds = " ".join(f"{speed:.6g}" for speed in before)
                return at, f"step {at} gave rotor speeds {speeds}, then others, by up to {by:.2g}"
    except Exception as error:
        return at + 1, f"step {at + 1}: {in_words(error)}"
    return 0, ""


def _given(step: FlownStep) -> Any:
    return own_copy(step.memory) if step.pickled is None else loads(step.pickled)


def _twice(subject: Subject, steps: list[FlownStep], _: list[FlownStep]) -> Taken:
    law = subject.build()
    for at, step in enumerate(steps):
        before = step.again(law, _given(step))[1].rotor_speeds.copy()
        yield at, before, step.again(law, _given(step))[1].rotor_speeds


def _chained(subject: Subject, *flights: list[FlownStep]) -> Taken:
    law, memories = subject.build(), [_given(flight[0]) for flight in flights]
    for at, steps in enumerate(zip_longest(*flights)):
        for number, step in enumerate(steps):
            if step is not None:
                memories[number], decision = step.again(law, memories[number])
                yield at, step.rotor_speeds, decision.rotor_speeds


def _from_old(subject: Subject, steps: list[FlownStep], _: list[FlownStep]) -> Taken:
    law = subject.build()
    for at in reversed(range(len(steps))):
        yield at, steps[at].rotor_speeds, steps[at].again(law, steps[at].memory)[1].rotor_speeds


def _from_pickled(subject: Subject, steps: list[FlownStep], _: list[FlownStep]) -> Taken:
    law = subject.build()
    for at, step in enumerate(steps):
        memory = loads(dumps(step.memory) if step.pickled is None else step.pickled)
        yield at, step.rotor_speeds, step.again(law, memory)[1].rotor_speeds


def _plain(steps: list[FlownStep]) -> Row:
    tried = "plain data, kept over a restart"
    try:
        size = max(len(to_bytes(step.memory)) for step in steps)
    except TypeError as error:
        return Row("", tried, Result.FIGURE, f"no, after a restart it starts from initial(): {error}")
    return Row("", tried, Result.OK, f"up to {size} bytes")


_TRIALS = (
    RepeatedSteps(
        "the same step twice",
        _twice,
        "a = s[{k}]; print(*(a.again(law, a.memory)[1].rotor_speeds.tolist() for _ in range(2)))",
    ),
    RepeatedSteps(
        "the same flight by a new instance",
        lambda subject, steps, _: _chained(subject, steps),
        "m = s[0].memory; print([(m := (r := a.again(law, m))[0], a.rotor_speeds.tolist(), "
        "r[1].rotor_speeds.tolist())[1:] for a in s][{k}])",
    ),
    RepeatedSteps(
        "two flights in turn by one law",
        _chained,
        "a, b = s[{k}], s[-1]; print(a.rotor_speeds.tolist(), b.again(law, b.memory)[1].rotor_speeds.tolist(), "
        "a.again(law, a.memory)[1].rotor_speeds.tolist())",
    ),
    RepeatedSteps(
        "stepped again from an old memory",
        _from_old,
        "a = s[{k}]; print(a.rotor_speeds.tolist(), a.again(law, a.memory)[1].rotor_speeds.tolist())",
    ),
    RepeatedSteps(
        "stepped from a memory pickled and read back",
        _from_pickled,
        "import pickle; a = s[{k}]; print(a.rotor_speeds.tolist(), "
        "a.again(law, pickle.loads(pickle.dumps(a.memory)))[1].rotor_speeds.tolist())",
    ),
)
