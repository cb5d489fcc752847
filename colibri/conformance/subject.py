"""The law under test, commands that repeat its flights, and rows."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from shlex import join, quote
from time import perf_counter
from typing import Any, NamedTuple, TypeAlias

from colibri.autopilot.control.interface import Controller
from colibri.autopilot.control.law_files import table_of
from colibri.autopilot.control.loop import build_controller
from colibri.autopilot.control.profile import Profile, load_profile, profile_names
from colibri.autopilot.control.registry import Factory, factory_of, load_controller
from colibri.autopilot.spec import LawSpec
from colibri.flights.plan import FlightPlan
from colibri.flights.spec import FlightSpec
from colibri.plant.vehicle.description import Vehicle

_DEFAULT_PROFILE = "flight"
_MODULE = "colibri.conformance"
_SHELLS = set('"$`\\!')  # special characters between double quotes


@dataclass(frozen=True, slots=True)
class Subject:
    """A control law with its inputs; `given` are its options of `colibri.fly`."""

    law: Factory
    profile: Profile
    vehicle: Vehicle
    seed: int
    duration_s: float
    given: Mapping[str, Any]

    @classmethod
    def of(cls, controller: Any, profile: Any, vehicle: Any, seed: int, duration_s: float = 30.0) -> "Subject":
        """Resolve a law as `colibri.fly` does; profile and vehicle default to the law's."""
        named = isinstance(controller, str)
        law = load_controller(controller) if named else factory_of(controller)
        profile = profile or profile_for(LawSpec(controller=controller).law_name or "")
        given = {"controller": controller, "profile": profile} | ({"vehicle": vehicle} if vehicle else {})
        plan = FlightPlan.of(FlightSpec.of("hover", **given, link="direct"))
        return cls(law, plan.profile, plan.vehicle, seed, duration_s, given)

    @property
    def name(self) -> str:
        return self.profile.controller

    def start(self, **changed: float) -> dict[str, float]:
        """Return a start in hover 2 m above the origin, with changes."""
        return {"x": 0.0, "y": 0.0, "z": 2.0, "rotors": round(self.vehicle.hover_rpm, 3), **changed}

    def build(self, profile: Profile | None = None, vehicle: Vehicle | None = None) -> Controller[Any]:
        return build_controller(profile or self.profile, vehicle or self.vehicle, perf_counter, self.law)

    def plan(self, track: str, out: Path = Path(), **options: Any) -> FlightPlan:
        every = {**self.given, "link": "direct", "seed": self.seed, "out": out, **options}
        return FlightPlan.of(FlightSpec.of(track, **every))

    def command(self, track: str, **options: Any) -> str:
        """Return a command, or Python, that repeats the flight."""
        every = {**self.given, "link": "direct", "seed": self.seed, **options}
        if all(isinstance(value, str) for value in self.given.values()):
            return f"colibri fly {join([track, *(_option(*each) for each in every.items())])}"
        return f"colibri.fly({track!r}, {_words(every)})"

    def snippet(self, code: str, track: str, **options: Any) -> str:
        """Return Python that runs `code` with law `law` and steps `s` of a flight."""
        names = ["flown_steps", *(name for name in ("jumped", "rebuilt") if f"{name}(" in code)]
        return self.script(f"law, s = flown_steps({self.call(track, **options)}); {code}", *names)

    def script(self, code: str, *names: str) -> str:
        """Return Python with imports, as a shell command if possible."""
        code = f"from {_MODULE} import {', '.join(names)}; {code}"
        if not all(isinstance(value, str) for value in self.given.values()):
            return code
        return f"python -c {quote(code)}" if _SHELLS & set(code) else f'python -c "{code}"'

    def call(self, track: str, **options: Any) -> str:
        return f"{track!r}, {_words({**self.given, 'seed': self.seed, **options})}"

    @property
    def of_law(self) -> str:
        return _words(self.given)


def built(*, controller: Any, profile: Any = None, vehicle: Any = None) -> Controller[Any]:
    """Build a control law from its name or class."""
    return Subject.of(controller, profile, vehicle, 0).build()


def profile_for(controller: str) -> str:
    """Return the law's own profile, else one with its numbers, else the default."""
    profiles = {name: load_profile(name) for name in [_DEFAULT_PROFILE, *profile_names()]}
    controller = table_of(controller)
    own = [name for name, profile in profiles.items() if profile.controller == controller]
    known = [name for name, profile in profiles.items() if controller in profile.controllers]
    return next(iter([*own, *known, _DEFAULT_PROFILE]))


def _words(options: Mapping[str, Any]) -> str:
    return ", ".join(f"{name}={_word(value)}" for name, value in options.items())


def _word(value: Any) -> str:
    if isinstance(value, str | int | float | dict):
        return repr(value)
    return str(getattr(value, "__name__", type(value).__name__.lower()))


def _option(name: str, value: Any) -> str:
    said = ",".join(f"{key}={each!r}" for key, each in value.items()) if isinstance(value, Mapping) else value
    return f"--{name.replace('_', '-')}={said}"


class Result(StrEnum):
    OK = "ok"
    NEAR = "near"  # a limit
    FAILED = "failed"
    NOT_APPLICABLE = "not applicable"
    FIGURE = "figure"


class Row(NamedTuple):
    """A trial, whose area `check_controller` adds; `see` shows its failure."""

    area: str
    tried: str
    result: Result
    found: str
    see: str = ""


Check: TypeAlias = Callable[[Subject], Iterator[Row]]
"""Yields the rows of one area."""


def judged(tried: str, failure: str, found: str, see: str) -> Row:
    return Row("", tried, Result.FAILED, failure, see) if failure else Row("", tried, Result.OK, found)


def not_applicable(tried: str, why: str) -> Row:
    return Row("", tried, Result.NOT_APPLICABLE, why)
