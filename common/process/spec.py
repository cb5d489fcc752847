"""Common options of plant and autopilot processes, and the starting process."""

import sys
from argparse import SUPPRESS, Namespace
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NamedTuple, TypeVar

from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.lifecycle import end_with, fail
from colibri.common.spec import Option, SpecError, from_json, from_namespace

S = TypeVar("S")
_BOOT = "Unix time at simulated time 0, for dates in telemetry logs; the same for plant and autopilot"


@dataclass(frozen=True, kw_only=True)
class ProcessSpec:
    system_id: Annotated[int, Option("MAVLink system id", "ID", least=1, most=255)] = 1
    out: Annotated[Path | None, Option("folder for flight.ulg", "DIR")] = None
    boot_unix_us: Annotated[int, Option(_BOOT, "N", "µs", least=0)] = 0


class Starter(NamedTuple):
    """The starter of a process, which ends with its `parent`."""

    as_json: bool = False  # status as JSON lines on standard output
    parent: int | None = None  # process id


def add_process_options(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add("--json", action="store_true", help="print status as JSON lines")
    add("--parent", type=int, metavar="PID", help="end when the process with this id ends")
    add("--spec", action="store_true", help=SUPPRESS)


def read_process(spec: type[S], args: Namespace) -> tuple[S, Starter]:
    """Read the command line, or with `--spec` JSON from standard input."""
    starter = Starter(args.json, args.parent)
    if args.parent is not None:
        end_with(args.parent)
    if not args.spec:
        return from_namespace(spec, args), starter
    try:
        return from_json(spec, sys.stdin.buffer.read()), starter
    except SpecError as error:
        fail(str(error))
