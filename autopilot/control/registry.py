"""Control laws by name: entry points, construction, and checks."""

from collections.abc import Callable, Mapping
from functools import cache
from hashlib import sha256
from importlib.metadata import EntryPoint, EntryPoints, entry_points
from importlib.util import find_spec
from numbers import Integral
from pathlib import Path
from sys import modules
from typing import Any, NamedTuple, TypeAlias, cast

import numpy as np

from colibri.autopilot.control.interface import Clock, Controller, Decision, Preview
from colibri.autopilot.control.law_files import full_name, is_place, law_at
from colibri.autopilot.control.settings import current_name
from colibri.autopilot.errors import AutopilotError
from colibri.common.errors import Error, ForeignError, InFlightError, checked, unknown
from colibri.common.types import Array, PerRotor
from colibri.plant.vehicle.description import Rotors, Vehicle

GROUP = "colibri.controllers"
DEFAULT = "cascade"
_MAX_PREVIEW = 10_000


class ControllerError(AutopilotError):
    """An unusable control law."""


class DecisionError(AutopilotError, InFlightError):
    """A decision outside the rotors' limits, or of the wrong type."""


class LawError(DecisionError, ForeignError):
    """A control law raised in flight."""


class BuildError(ControllerError, ForeignError):
    """A control law raised during construction."""


Factory: TypeAlias = Callable[[Mapping[str, Any], Vehicle, Clock], Controller[Any]]  # of a profile's table


def controller_names() -> list[str]:
    """Return the names of the installed control laws."""
    return sorted({entry.name for entry in registered()})


@cache
def registered() -> EntryPoints:
    """Return the entry points of all laws; cached: this reads a file of every package."""
    return entry_points(group=GROUP)


def load_controller(name: str) -> Factory:
    """Return the factory registered as `name`, or at a place such as `my_law.py`, `my_law:PID` or `policy.onnx`.

    Raises:
        ControllerError: The name is unknown, or its package cannot be loaded.
    """
    checked("controller", name, str, "a name", ControllerError)
    if is_place(name):
        return factory_of(law_at(full_name(name)))
    entry = _entry(name)
    try:
        factory: Factory = entry.load()
    except (ImportError, AttributeError) as error:
        raise ControllerError(f"controller {name} ({entry.value}) cannot be loaded: {error}") from error
    return factory


def _entry(name: str) -> EntryPoint:
    name = current_name(name)
    for entry in registered().select(name=name):
        return entry
    raise ControllerError(unknown("controller", name, controller_names()))


class Origin(NamedTuple):
    """Origin of a control law, for records."""

    entry: str  # module and name
    package: str  # with version
    sha256: str  # of the module's file; empty if there is none


def factory_of(law: Any) -> Factory:
    """Return what makes a control law: itself, or for a law that is already made, what returns it."""
    if isinstance(law, Controller) and not isinstance(law, type):
        return cast(Factory, Made(law))
    factory: Factory = law
    return factory


class Made(NamedTuple):
    """Returns a control law that was made before."""

    law: Controller[Any]

    def __call__(self, *_: object) -> Controller[Any]:
        return self.law

    @property
    def __name__(self) -> str:
        return type(self.law).__name__


def origin_of(name: str) -> Origin:
    if is_place(name):
        return origin_of_factory(load_controller(name))
    return registered_origin(name)


@cache
def registered_origin(name: str) -> Origin:
    entry = _entry(name)
    package = f"{entry.dist.name} {entry.dist.version}" if entry.dist else ""
    spec = find_spec(entry.module)
    return Origin(entry.value, package, _sha256(spec.origin if spec else None))


def origin_of_factory(law: Factory) -> Origin:
    law = type(law.law) if isinstance(law, Made) else law
    if hash_ := getattr(law, "sha256", ""):
        return Origin(getattr(law, "__name__", ""), "", hash_)
    module = getattr(law, "__module__", "")
    file = getattr(modules.get(module), "__file__", None)
    return Origin(f"{module}:{getattr(law, '__qualname__', type(law).__qualname__)}", "", _sha256(file))


def _sha256(file: str | None) -> str:
    return sha256(Path(file).read_bytes()).hexdigest() if file and Path(file).is_file() else ""


def check_controller(name: str, controller: object) -> None:
    if not isinstance(controller, Controller):
        raise ControllerError(f"controller {name} needs control_interval_us, preview, initial() and step()")
    interval_us = controller.control_interval_us
    if not isinstance(interval_us, Integral) or not 1_000 <= interval_us <= 1_000_000 or interval_us % 1_000:
        raise ControllerError(
            f"controller {name}: control_interval_us must be whole milliseconds up to a second, not {interval_us} µs"
        )


def check_preview(name: str, preview: object) -> None:
    if not isinstance(preview, Preview) or not all(isinstance(each, Integral) and each > 0 for each in preview):
        raise ControllerError(f"controller {name}: preview must be a colibri.Preview of whole numbers, not {preview}")
    if preview.samples > _MAX_PREVIEW:
        raise ControllerError(
            f"controller {name}: preview must have 1 to {_MAX_PREVIEW} samples, not {preview.samples}"
        )


def in_words(error: BaseException) -> str:
    words = " ".join(str(error).split())
    if words and isinstance(error, Error):
        return words
    return f"{type(error).__name__}: {words}" if words else type(error).__name__


def check_answer(name: str, answer: object, time_us: int) -> None:
    if isinstance(answer, tuple) and len(answer) == 2 and isinstance(answer[1], Decision):
        return
    raise DecisionError(
        f"controller {name} returned {type(answer).__name__} at t = {time_us / 1e6:.3f} s: "
        "expected two, what it remembers and a Decision"
    )


def check_rotor_speeds(name: str, rotor_speeds: Array, rotors: Rotors, time_us: int | None = None) -> PerRotor:
    speeds, max_speed = np.asarray(rotor_speeds).tolist(), rotors.max_speed
    if isinstance(speeds, list) and len(speeds) == len(rotors.position_m):
        for speed in speeds:
            if not 0.0 <= speed <= max_speed:
                break
        else:
            return tuple(speeds)
    when = "" if time_us is None else f" at t = {time_us / 1e6:.3f} s"
    raise DecisionError(
        f"controller {name} gave rotor speeds {rotor_speeds}{when}: expected {rotors.count} from 0 to {max_speed:g}"
    )
