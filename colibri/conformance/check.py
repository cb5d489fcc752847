"""`check_controller`: every check of a control law, and their table."""

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from html import escape
from typing import Any

from colibri.analysis.tables import markdown, print_table
from colibri.common.errors import Error, unknown
from colibri.common.process.lifecycle import EXIT_FAILED, one_line
from colibri.conformance.interface_checks import interface_checks, limit_checks
from colibri.conformance.loop_flight import restart_checks
from colibri.conformance.optional_checks import memory_checks, optional_checks
from colibri.conformance.step_records import flight_checks, time_checks
from colibri.conformance.subject import Check, Result, Row, Subject
from colibri.experiments.flight import table_html

CHECKS: dict[str, Check] = {
    "interface": interface_checks,
    "memory": memory_checks,
    "limits": limit_checks,
    "optional": optional_checks,
    "time": time_checks,
    "flights": flight_checks,
    "restart": restart_checks,
}
"""Checks by area, in order."""
HEADINGS = ("area", "tried", "result", "found")
DURATION_S = 30.0


@dataclass(frozen=True, slots=True)
class Conformance:
    """Results of the checks of a control law."""

    name: str
    flown_by: str
    rows: tuple[Row, ...]

    @property
    def passed(self) -> bool:
        return not self.failed

    @property
    def failed(self) -> tuple[Row, ...]:
        return tuple(row for row in self.rows if row.result is Result.FAILED)

    @property
    def title(self) -> str:
        return f"{self.name}, {self.flown_by}: {len(self.failed)} of {len(self.rows)} failed"

    @property
    def failures(self) -> str:
        return "".join(f"FAILED  {row.area}: {row.tried}: {row.found}\n   see  {row.see}\n" for row in self.failed)

    def __str__(self) -> str:
        return markdown(HEADINGS, [_cells(row) for row in self.rows], names=len(HEADINGS)) + self.failures

    def _repr_html_(self) -> str:
        return table_html(self.title, map(_cells, self.rows)) + f"<pre>{escape(self.failures)}</pre>"


def check_controller(
    controller: Any,
    *,
    profile: Any = None,
    vehicle: Any = None,
    seed: int = 0,
    duration: float = DURATION_S,
    only: tuple[str, ...] | list[str] = (),
    progress: Callable[[str], None] = lambda _area: None,
) -> Conformance:
    """Test a control law against the requirements on every control law.

    Args:
        controller: Registered name, class, or factory, as for `colibri.fly`.
        profile: Name, file or `Profile`; by default the law's own, or one with its numbers, else `flight`.
        vehicle: Name, file or `Vehicle`; by default the profile's.
        seed: Seed of random states and references, and of the weather.
        duration: Simulated time of each track, s.
        only: Areas to try; empty for all.
        progress: Called with each area before its trials.
    """
    for area in only:
        if area not in CHECKS:
            raise Error(unknown("area", area, CHECKS))
    subject = Subject.of(controller, profile, vehicle, seed, duration)
    subject.build()

    def rows() -> Iterator[Row]:
        for area, check in CHECKS.items():
            if not only or area in only:
                progress(area)
                yield from (row._replace(area=area) for row in check(subject))

    flown_by = f"profile {subject.profile.name}, vehicle {subject.vehicle.name}, seed {seed}"
    return Conformance(subject.name, flown_by, tuple(rows()))


def command(args: argparse.Namespace) -> int:
    from rich.console import Console

    console = Console(stderr=True)
    with one_line(), console.status("") as status:
        options = {name: getattr(args, name) for name in ("profile", "vehicle", "seed", "duration", "only")}
        found = check_controller(args.name, **options, progress=lambda area: status.update(f"{args.name}: {area}"))
    if not args.quiet:
        print_table(found.title, HEADINGS, [_cells(row) for row in found.rows], names=len(HEADINGS))
    print(found.failures, end="")  # noqa: T201
    return 0 if found.passed else EXIT_FAILED


def _cells(row: Row) -> tuple[str, ...]:
    return row.area, row.tried, str(row.result), row.found
