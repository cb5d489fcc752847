"""Rebuild a law from other numbers, as parameter changes in flight do."""

from collections.abc import Iterator
from typing import Any, NamedTuple

from colibri.autopilot.control.interface import Controller
from colibri.autopilot.control.registry import BuildError
from colibri.autopilot.parameters.number_paths import Number, changed, described, paths, read
from colibri.common.errors import Error
from colibri.conformance.subject import Subject

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
