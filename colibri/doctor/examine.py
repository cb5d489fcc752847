"""`colibri doctor`: run the checks and print their findings."""

import argparse
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import TypeAlias

from colibri.common.process.lifecycle import EXIT_FAILED
from colibri.doctor.checks import (
    Finding,
    Severity,
    beyond,
    extras,
    flight,
    ground_station,
    lock,
    loopback,
    machine_code,
    packages,
    ports,
    python,
)
from colibri.mavlink.links.open import open_ground_link

Check: TypeAlias = Callable[[], Finding | Iterable[Finding] | None]

CHECKS: tuple[Check, ...] = (python, packages, lock, machine_code, loopback, ports, beyond, flight, extras)
"""In order."""
_COLORS = {Severity.FINE: "green", Severity.NOTE: "yellow", Severity.FAILED: "bold red"}


def examine(checks: Iterable[Check] = CHECKS) -> Iterator[Finding]:
    for check in checks:
        found = check()
        if isinstance(found, Finding):
            yield found
        elif found is not None:
            yield from found


def examine_as_told(args: argparse.Namespace) -> int:
    link = None if args.gcs is None else open_ground_link(args.gcs)
    asked: list[Check] = [] if link is None else [partial(ground_station, link, args.within)]
    failed = 0
    for finding in examine([*CHECKS, *asked]):
        failed += finding.verdict is Severity.FAILED
        show(finding)
    if link is not None:
        link.close()
    return EXIT_FAILED if failed else 0


def show(finding: Finding) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table.grid(padding=(0, 2))
    for width in (6, 26):
        table.add_column(width=width, no_wrap=True)
    table.add_column()
    table.add_row(Text(finding.verdict, _COLORS[finding.verdict]), Text(finding.checked), Text(finding.found))
    if finding.advice:
        table.add_row("", "", Text(f"→ {finding.advice}"))
    Console().print(table)
