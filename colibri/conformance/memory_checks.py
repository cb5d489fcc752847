"""Explicit memory: equal inputs give equal outputs, bit for bit."""

from collections.abc import Callable, Iterator
from itertools import zip_longest
from pickle import dumps, loads
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from colibri.autopilot.control.registry import in_words
from colibri.common.serialization import to_bytes
from colibri.common.types import Array
from colibri.conformance.step_records import FlownStep, fly_for_steps, own_copy
from colibri.conformance.subject import Result, Row, Subject, judged, not_applicable

_TRACK, _OTHER = "lemniscate:lap=10,height=5", "hover:height=3"
_S, _SAMPLES = 0.6, 8
"""Duration, and least number of samples."""

Taken: TypeAlias = Iterator[tuple[int, Array, Array]]
"""Number of a step, and its original and repeated rotor speeds."""


class RepeatedSteps(NamedTuple):
    """A way to repeat steps; `code` shows a difference at step {k}."""

    tried: str
    take: Callable[[Subject, list[FlownStep], list[FlownStep]], Taken]
    code: str


def memory_checks(subject: Subject) -> Iterator[Row]:
    seconds = max(_S, _SAMPLES * subject.build().control_interval_us * 1e-6)
    options = {"start": subject.start(x=0.5, z=5.0), "duration": seconds}
    steps = fly_for_steps(subject, _TRACK, **options).steps
    others = fly_for_steps(subject, _OTHER, start=subject.start(phi=20.0, vx=1.0), duration=seconds).steps
    if not steps or not others:
        yield not_applicable("steps taken again", "it took no step")
        return
    count = f"{len(steps)} steps"
    for trial in _TRIALS:
        at, failure = _difference(trial.take(subject, steps, others))
        yield judged(trial.tried, failure, count, subject.snippet(trial.code.format(k=at), _TRACK, **options))
    changed = [k for k, step in enumerate(steps) if step.changed]
    failure = f"it writes to them, at step {changed[0]} first" if changed else ""
    see = subject.snippet("print([k for k, a in enumerate(s) if a.changed])", _TRACK, **options)
    yield judged("references left as they are", failure, count, see)
    now = (np.array(step.decision.rotor_speeds) for step in steps)
    late = any(step.rotor_speeds.tobytes() != speeds.tobytes() for step, speeds in zip(steps, now, strict=True))
    failure = "it overwrites the rotor speeds that it has returned: return a new array" if late else ""
    see = subject.snippet("print(s[0].rotor_speeds.tolist(), s[0].decision.rotor_speeds.tolist())", _TRACK, **options)
    yield judged("decisions left as they were", failure, count, see)
    yield _plain(steps)


def _difference(taken: Taken) -> tuple[int, str]:
    at = -1
    try:
        for at, before, after in taken:
            if before.tobytes() != after.tobytes():
                by = float(np.abs(after - before).max())
                return at, f"step {at} gave rotor speeds {_words(before)}, then others, by up to {by:.2g}"
    except Exception as error:
        return at + 1, f"step {at + 1}: {in_words(error)}"
    return 0, ""


def _words(speeds: Array) -> str:
    return " ".join(f"{speed:.6g}" for speed in speeds)


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
