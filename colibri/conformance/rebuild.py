"""The same law built from other numbers, as a ground station's parameters change them in flight."""

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
    """A law built from one other number.

    Attributes:
        key: Of the number, in the law's table or the vehicle's.
        value: That it has.
        law: None where the law refuses the number, or has another rhythm with it.
        raised: What it raised that is no refusal; empty if nothing.
    """

    key: str
    value: float
    law: Controller[Any] | None
    raised: str


def rebuilt(key: str, value: float, *, controller: Any, profile: Any = None, vehicle: Any = None) -> Controller[Any]:
    """Return a control law built from one other number.

    Args:
        key: In the law's table, with places in lists in brackets; or `body.mass_kg`.
        value: That it is to have.
        controller: Name or class, as `colibri.fly` takes it.
        profile: Name, file or `Profile`; None: the one with numbers for the law.
        vehicle: Name, file or `Vehicle`; None: the profile's.

    Raises:
        Error: It cannot be built.
    """
    return _build(Subject.of(controller, profile, vehicle, 0), key, value)


def rebuilds(subject: Subject) -> Iterator[Rebuilt]:
    """Yield laws with another mass, and with up to 16 numbers of the table, each 5 % higher by itself."""
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
