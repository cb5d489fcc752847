"""`check_controller`: every check of a control law, and the table of what came of them."""

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from html import escape
from typing import Any

from colibri.common.errors import Error, unknown
from colibri.common.process.lifecycle import EXIT_FAILED, fail
from colibri.conformance.flight_checks import flight_checks, time_checks
from colibri.conformance.interface_checks import interface_checks
from colibri.conformance.limit_checks import limit_checks
from colibri.conformance.memory_checks import memory_checks
from colibri.conformance.optional_checks import optional_checks
from colibri.conformance.restart_checks import restart_checks
from colibri.conformance.rows import Check, Result, Row
from colibri.conformance.subject import Subject
from colibri.experiments.notebook import table_html

CHECKS: dict[str, Check] = {
    "interface": interface_checks,
    "memory": memory_checks,
    "limits": limit_checks,
    "optional": optional_checks,
    "time": time_checks,
    "flights": flight_checks,
    "restart": restart_checks,
}
"""What is tried, in this order, by area."""
HEADINGS = ("area", "tried", "result", "found")
DURATION_S = 30.0


class AreaError(Error):
    """An area that there is not."""


@dataclass(frozen=True, slots=True)
class Conformance:
    """What came of a control law.

    Attributes:
        name: Of the law.
        flown_by: Profile and vehicle.
        rows: Every trial, in the order in which they were made.
    """

    name: str
    flown_by: str
    rows: tuple[Row, ...]

    @property
    def passed(self) -> bool:
        """Whether nothing failed."""
        return not self.failed

    @property
    def failed(self) -> tuple[Row, ...]:
        """The trials that failed."""
        return tuple(row for row in self.rows if row.result is Result.FAILED)

    @property
    def title(self) -> str:
        """What was tried, and on what."""
        return f"{self.name}, {self.flown_by}: {len(self.failed)} of {len(self.rows)} failed"

    @property
    def failures(self) -> str:
        """What failed, and how to see it: two lines each."""
        return "".join(f"FAILED  {row.area}: {row.tried}: {row.found}\n   see  {row.see}\n" for row in self.failed)

    def __str__(self) -> str:
        """Return the table as Markdown, and what failed below it."""
        from colibri.analysis.tables import markdown

        return markdown(HEADINGS, [_cells(row) for row in self.rows], names=len(HEADINGS)) + self.failures

    def _repr_html_(self) -> str:
        """Return the table as a notebook shows it."""
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
    """Try on a control law what every control law must satisfy.

    Args:
        controller: Name under which it is registered; or a class, or what else makes one, as `colibri.fly` takes it.
        profile: Name, file or `Profile`; None: the one whose law it is, or that has numbers for it, else `flight`.
        vehicle: Name, file or `Vehicle`; None: the profile's.
        seed: Of the random states and references, and of the weather.
        duration: Simulated time to fly each track, s.
        only: Areas to try; empty for all.
        progress: Called with each area before it is tried.

    Raises:
        Error: There is no such law, area, profile or vehicle, or the law cannot be built.
    """
    for area in only:
        if area not in CHECKS:
            raise AreaError(unknown("area", area, CHECKS))
    subject = Subject.of(controller, profile, vehicle, seed, duration)
    subject.build()

    def rows() -> Iterator[Row]:
        for area, check in CHECKS.items():
            if not only or area in only:
                progress(area)
                yield from check(subject)

    flown_by = f"profile {subject.profile.name}, vehicle {subject.vehicle.name}, seed {seed}"
    return Conformance(subject.name, flown_by, tuple(rows()))


def check_by_command(args: argparse.Namespace) -> int:
    """Check as the command line says; return 1 if something failed."""
    from rich.console import Console

    from colibri.analysis.tables import print_table

    console = Console(stderr=True)
    try:
        with console.status("") as status:
            found = check_controller(
                args.name,
                profile=args.profile,
                vehicle=args.vehicle,
                seed=args.seed,
                duration=args.duration,
                only=args.only,
                progress=lambda area: status.update(f"{args.name}: {area}"),
            )
    except Error as error:
        fail(str(error))
    if not args.quiet:
        print_table(found.title, HEADINGS, [_cells(row) for row in found.rows], names=len(HEADINGS))
    print(found.failures, end="")  # noqa: T201
    return 0 if found.passed else EXIT_FAILED


def _cells(row: Row) -> tuple[str, ...]:
    return row.area, row.tried, str(row.result), row.found
