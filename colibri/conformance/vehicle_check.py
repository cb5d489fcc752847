"""`check_vehicle`: fly a vehicle file, and find out how wrong its numbers may be."""

import argparse
import json
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from math import floor, isnan
from time import perf_counter
from typing import Any, NamedTuple

from colibri.analysis.lost import LIMIT_CYCLE_RAD_S
from colibri.analysis.report import length
from colibri.analysis.tables import markdown, print_table
from colibri.autopilot.control.loop import build_controller
from colibri.autopilot.control.profile import Profile
from colibri.autopilot.control.scaling import capability_of
from colibri.campaigns.engines import Engine, in_order
from colibri.campaigns.run import engine_of
from colibri.common.process.lifecycle import EXIT_FAILED, fail, one_line
from colibri.conformance.subject import Result
from colibri.conformance.vehicle_flights import (
    EMPTY,
    FAR_M,
    HOVER,
    MAX_FACTOR,
    NUMBERS,
    TRIALS,
    Flown,
    Tolerance,
    bound_of,
    fly,
    has_number,
    thrust_ratio,
)
from colibri.flights.folder import make_folder
from colibri.flights.spec import FlightSpec
from colibri.plant.vehicle.description import Vehicle, load_vehicle

HEADINGS = ("check", "result", "found", "near from", "fails from", "why")
TOLERANCE_HEADINGS = ("number", "result", "file / truth", "below", "above")
_HOW_WRONG = "how wrong each number may be"
_LITTLE_THRUST, _LEAST_THRUST = 1.5, 1.05
_NEAR_SWING = 0.5 * LIMIT_CYCLE_RAD_S


class Check(NamedTuple):
    """A number of the vehicle or of a flight, and from where it is near a limit or fails."""

    name: str
    result: Result
    found: float
    near: float
    fails: float | None
    unit: str
    why: str = ""

    @property
    def cells(self) -> tuple[str, ...]:
        found = length(self.found) if self.unit == "m" else f"{self.found:.3g} {self.unit}".rstrip()
        fails = "-" if self.fails is None else f"{self.fails:g}"
        return self.name, str(self.result), "-" if isnan(self.found) else found, f"{self.near:g}", fails, self.why


@dataclass(frozen=True, slots=True)
class VehicleCheck:
    """Results of the checks of a vehicle file; without tolerances if it fails."""

    name: str
    flown_by: str
    checks: tuple[Check, ...]
    tolerances: tuple[Tolerance, ...]

    @property
    def passed(self) -> bool:
        return not self.failed

    @property
    def failed(self) -> tuple[Check, ...]:
        return tuple(check for check in self.checks if check.result is Result.FAILED)

    @property
    def title(self) -> str:
        results = [*(check.result for check in self.checks), *(each.result for each in self.tolerances)]
        near = results.count(Result.NEAR)
        return f"{self.name}, {self.flown_by}: {len(self.failed)} failed, {near} near a limit"

    def __str__(self) -> str:
        return "\n".join(markdown(headings, cells, names=2) for headings, cells in self.tables())

    def tables(self) -> Iterator[tuple[tuple[str, ...], list[tuple[str, ...]]]]:
        yield HEADINGS, [check.cells for check in self.checks]
        if self.tolerances:
            yield TOLERANCE_HEADINGS, [tolerance.cells for tolerance in self.tolerances]

    def facts(self) -> dict[str, Any]:
        """Return what `check.json` has; numbers that are unknown are null."""
        checks = [check._asdict() | {"found": None if isnan(check.found) else check.found} for check in self.checks]
        tolerances = [
            {"name": each.name, "result": each.result, "least": each.least._asdict(), "most": each.most._asdict()}
            for each in self.tolerances
        ]
        named = {"vehicle": self.name, "flown_by": self.flown_by, "passed": self.passed}
        return named | {"checks": checks, "tolerances": tolerances}


class _Job(NamedTuple):
    """A trial, or with a factor the search for a number's bound."""

    name: str
    factor: float = 1.0


def check_vehicle(
    vehicle: str | Vehicle,
    *,
    profile: Any = "flight",
    controller: Any = None,
    seed: int = 0,
    workers: int | None = None,
    quiet: bool = True,
) -> VehicleCheck:
    """Fly a vehicle by its file alone, then by files with one wrong number.

    Args:
        vehicle: Name, file or `Vehicle`.
        profile: Name, file or `Profile`.
        controller: As for `colibri.fly`; by default the profile's.
        seed: Seed of turbulence and sensors.
        workers: Number of processes; by default one per core.
        quiet: Show no progress.
    """
    return _Subject.of(vehicle, profile, controller, seed, workers).check(quiet=quiet)


class _Subject(NamedTuple):
    """A vehicle that the law accepts."""

    vehicle: Vehicle
    profile: Profile
    law: Mapping[str, Any]
    engine: Engine

    @classmethod
    def of(cls, vehicle: str | Vehicle, profile: Any, controller: Any, seed: int, workers: int | None) -> "_Subject":
        law = {"profile": profile, "controller": controller, "seed": seed}
        spec = FlightSpec.of(HOVER, vehicle=load_vehicle(vehicle), **law)
        chosen, described = spec.load()
        build_controller(chosen, described, perf_counter, spec.law)
        return cls(described, chosen, law, engine_of(workers, None))

    def check(self, *, quiet: bool) -> VehicleCheck:
        vehicle, profile = self.vehicle, self.profile
        trials = [name for name, trial in TRIALS.items() if all(getattr(vehicle, part) for part in trial.requires)]
        numbers = [number for number in NUMBERS if has_number(vehicle, number)]
        searches = [_Job(number, factor) for number in numbers for factor in (1.0 / MAX_FACTOR, MAX_FACTOR)]
        work, jobs = partial(_done, vehicle, self.law), [*map(_Job, trials), *searches]
        found = in_order(work, jobs, "flights", quiet=quiet, engine=self.engine)
        flown, bounds = dict(zip(trials, found, strict=False)), found[len(trials) :]
        checks = (*_limits(vehicle, profile.table(profile.controller)), *_flights(flown))
        tolerances = tuple(map(Tolerance, numbers, bounds[::2], bounds[1::2]))
        if any(each.lost for each in flown.values()):
            tolerances = ()
        return VehicleCheck(vehicle.name, f"profile {profile.name}, law {profile.controller}", checks, tolerances)


def _done(vehicle: Vehicle, law: Mapping[str, Any], job: _Job) -> Any:
    if job.factor == 1.0:
        return fly(vehicle, TRIALS[job.name], law)
    return bound_of(vehicle, job.name, job.factor, law)


def _limits(vehicle: Vehicle, table: Mapping[str, Any]) -> Iterator[Check]:
    yield _thrust("thrust / weight", thrust_ratio(vehicle))
    if vehicle.battery is not None:
        yield _thrust("thrust / weight, battery empty", thrust_ratio(vehicle, EMPTY))
    lag_s, slow_s = capability_of(vehicle).lag_s, table.get("scaling", {}).get("lag_s")
    if slow_s is not None and vehicle.rotors.lag is not None:
        near = lag_s > slow_s
        why = f"slows the law down, {lag_s / slow_s:.1f} times" if near else ""
        yield Check("rotor lag", Result.NEAR if near else Result.OK, 1e3 * lag_s, 1e3 * slow_s, None, "ms", why)


def _thrust(name: str, ratio: float) -> Check:
    result = Result.FAILED if ratio < _LEAST_THRUST else Result.NEAR if ratio < _LITTLE_THRUST else Result.OK
    return Check(name, result, floor(100.0 * ratio) / 100.0, _LITTLE_THRUST, _LEAST_THRUST, "")


def _flights(flown: Mapping[str, Flown]) -> Iterator[Check]:
    for name, (lost, error_m, swing_rad_s) in flown.items():
        near = error_m > TRIALS[name].usual_m or swing_rad_s > _NEAR_SWING
        result = Result.FAILED if lost else Result.NEAR if near else Result.OK
        why = lost or (f"swings: {swing_rad_s:.1f} rad/s" if swing_rad_s > _NEAR_SWING else "")
        yield Check(name, result, error_m, TRIALS[name].usual_m, FAR_M, "m", why)


def command(args: argparse.Namespace) -> int:
    from colibri.conformance.vehicle_figure import FIGURE, draw_tolerances

    with one_line():
        subject = _Subject.of(args.vehicle, args.profile, args.controller, args.seed, args.workers)
        make_folder(args.out, without=(FIGURE,))
        checked = subject.check(quiet=args.quiet or args.json)
    text = json.dumps(checked.facts(), indent=1) + "\n"
    written = [args.out / "check.json"]
    written[0].write_text(text, encoding="utf-8")
    if checked.tolerances:
        written.append(args.out / FIGURE)
        draw_tolerances(checked.name, checked.tolerances).savefig(written[-1])
    if args.json:
        sys.stdout.write(text)
    elif not args.quiet:
        for title, (headings, cells) in zip((checked.title, _HOW_WRONG), checked.tables(), strict=False):
            print_table(title, headings, cells, names=2)
        sys.stdout.write(f"written to {', '.join(map(str, written))}\n")
    if not checked.passed:
        fail(f"{args.vehicle}: {', '.join(each.name for each in checked.failed)} failed", EXIT_FAILED)
    return 0
