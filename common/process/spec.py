"""What plant and autopilot have in common as processes, and who started one."""

import sys
from argparse import SUPPRESS, Namespace
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NamedTuple, TypeVar

from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.lifecycle import fail
from colibri.common.spec import Option, SpecError, from_json, from_namespace

S = TypeVar("S")


@dataclass(frozen=True, kw_only=True)
class ProcessSpec:
    """Identity and logs of a process."""

    system_id: Annotated[int, Option("MAVLink system", "ID", least=1, most=255)] = 1
    out: Annotated[Path | None, Option("write flight.ulg there", "DIR")] = None
    boot_unix_us: Annotated[
        int,
        Option(
            "Unix time at simulated time 0, by which telemetry logs are dated; the same for plant and autopilot",
            "N",
            "µs",
            least=0,
        ),
    ] = 0


class Starter(NamedTuple):
    """Who started a process.

    Attributes:
        as_json: Whether it reads the status as JSON lines on standard output.
        parent: Its process, whose end ends this one; None for a user's.
    """

    as_json: bool = False
    parent: int | None = None


def add_process_options(parser: ArgumentParser) -> None:
    """Add the options by which another program starts a process."""
    add = parser.add_argument
    add("--json", action="store_true", help="status as JSON lines on standard output")
    add("--parent", type=int, metavar="PID", help="end when that process, which started this one, ends")
    add("--spec", action="store_true", help=SUPPRESS)


def read_process(spec: type[S], args: Namespace) -> tuple[S, Starter]:
    """Return what a command line describes, or with `--spec` the JSON on standard input; and who started the process.

    A specification that cannot be read ends the process with one line.
    """
    starter = Starter(args.json, args.parent)
    if not args.spec:
        return from_namespace(spec, args), starter
    try:
        return from_json(spec, sys.stdin.buffer.read()), starter
    except SpecError as error:
        fail(str(error))
