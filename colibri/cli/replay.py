"""`colibri replay`: its options, and its call."""

from argparse import Namespace
from pathlib import Path

from colibri.common.process.arguments import ArgumentParser


def add_options(parser: ArgumentParser) -> None:
    """Add the options of `colibri replay`."""
    add = parser.add_argument
    add(
        "tlog",
        type=Path,
        metavar="FLIGHT.TLOG",
        help="as `colibri fly` leaves it, with inputs.jsonl beside it; or its folder",
    )
    add("--quiet", action="store_true", help="say nothing but errors")


def run(args: Namespace) -> int:
    """Replay as the command line says; return the exit code."""
    from colibri.flights.replay import replay

    return replay(args)
