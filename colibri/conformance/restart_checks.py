"""Checks of restarts in flight, with memory or without, and of laws rebuilt from other numbers."""

from collections.abc import Iterator
from typing import Any, NamedTuple

from colibri.analysis.lost import LOST_M
from colibri.autopilot.control.interface import Controller
from colibri.autopilot.control.registry import BuildError, in_words
from colibri.autopilot.parameters.number_paths import Number, changed, described, paths, read
from colibri.common.errors import Error
from colibri.conformance.limit_checks import out_of_limits
from colibri.conformance.loop_flight import HOW, restart
from colibri.conformance.step_records import FlownStep, fly_for_steps
from colibri.conformance.subject import Row, Subject, judged, not_applicable

_MASS = "body.mass_kg"
_BY, _NUMBERS = 1.05, 16


class Rebuilt(NamedTuple):
    """A law with one changed number; `None` if it refused, changed its interval, or raised."""

    key: str
    value: float
    law: Controller[Any] | None
    raised: str


def rebuilt(key: str, value: float, *, controller: Any, profile: Any = None, vehicle: Any = None) -> Controller[Any]:
    """Build a control law with one number changed, in its table or `body.mass_kg`."""
    return _build(Subject.of(controller, profile, vehicle, 0), key, value)


def rebuilds(subject: Subject) -> Iterator[Rebuilt]:
    """Yield laws with another mass, and with up to 16 numbers of the table, each 5 % higher."""
    table = subject.profile.table(subject.name)
    found = [path for path in paths(table) if isinstance(read(table, path), float)]
    every = -(-len(found) // _NUMBERS) or 1
    yield _rebuilt(subject, _MASS, _BY * subject.vehicle.body.mass_kg)
    for path in found[::every]:
        yield _rebuilt(subject, described(path), _BY * read(table, path))


def _rebuilt(subject: Subject, key: str, value: float) -> Rebuilt:
    now = subject.build()
    try:
        law = _build(subject, key, value)
    except BuildError as error:
        return Rebuilt(key, value, None, str(error))
    except Error:
        return Rebuilt(key, value, None, "")
    same = (law.control_interval_us, law.preview) == (now.control_interval_us, now.preview)
    return Rebuilt(key, value, law if same else None, "")


def _build(subject: Subject, key: str, value: float) -> Controller[Any]:
    if key == _MASS:
        return subject.build(vehicle=subject.vehicle.replace(key, value))
    table = subject.profile.table(subject.name)
    path = next(path for path in paths(table) if described(path) == key)
    other = changed(table, [Number("number", path)], {"number": value}, {"number": read(table, path)})
    return subject.build(subject.profile.replace(f"controllers.{subject.name}", other))


AREA = "restart"
_TRACK = "circle:speed=1"
_ON_IT = {"x": 2.0, "psi": 90.0, "vy": 1.0}
_MAX_TILT_DEG = 45.0
_STEPS = 3
"""Steps with each changed number."""
_TRIED = {
    "seamless": "from its checkpoint, the same flight bit for bit",
    "anew": "restarted in flight, charge and mass kept",
    "blind": "restarted in flight, without a record",
}


def restart_checks(subject: Subject) -> Iterator[Row]:
    plan = subject.plan(_TRACK, start=subject.start(**_ON_IT))
    for how in HOW:
        failure, found = "", ""
        try:
            flown = restart(subject, how, plan)
        except Exception as error:
            failure = in_words(error)
        else:
            if how == "seamless" and not flown.is_plain:
                yield not_applicable(AREA, _TRIED[how], "its memory is not plain data")
                continue
            found = f"at most {flown.off_m.max():.2g} m off (unbroken {flown.unbroken_m.max():.2g} m)"
            if how == "seamless" and not flown.same:
                failure = f"another flight, {found}: is its memory always of the type that initial returns?"
            elif flown.off_m.max() > LOST_M or flown.tilt_deg > _MAX_TILT_DEG:
                failure = f"{found}, tilted {flown.tilt_deg:.0f}° at its end"
        code = f"print(restarted({subject.call(_TRACK, how=how, start=subject.start(**_ON_IT))}))"
        yield judged(AREA, _TRIED[how], failure, found, subject.script(code, "restarted"))
    yield _handed_over(subject)


def _handed_over(subject: Subject) -> Row:
    tried = "built from other numbers, handed the old memory"
    options = {"start": subject.start(**_ON_IT), "duration": max(0.3, 6e-6 * subject.build().control_interval_us)}
    steps = fly_for_steps(subject, _TRACK, **options).steps
    if len(steps) < _STEPS:
        return not_applicable(AREA, tried, "it took too few steps")
    flown, refused = 0, 0
    for key, value, law, raised in rebuilds(subject):
        failure = raised if law is None else _fails(subject, law, steps[-_STEPS:])
        flown, refused = flown + (law is not None), refused + (law is None)
        if failure:
            other = f"rebuilt({key!r}, {value!r}, {subject.of_law})"
            code = f"other, m = {other}, s[-3].memory; print([m := a.again(other, m)[0] for a in s[-3:]])"
            return judged(AREA, tried, f"{key} = {value:.6g}: {failure}", "", subject.snippet(code, _TRACK, **options))
    return judged(AREA, tried, "", f"{flown} laws, each with a number 5 % higher; {refused} refused", "")


def _fails(subject: Subject, law: Controller[Any], steps: list[FlownStep]) -> str:
    memory = steps[0].memory
    try:
        for step in steps:
            memory, decision = step.again(law, memory)
            wrong = out_of_limits(subject, decision)
            if wrong:
                return wrong
    except Exception as error:
        return in_words(error)
    return ""
