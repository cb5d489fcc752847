"""`colibri replay`: its options, and its call."""

from argparse import Namespace
from pathlib import Path

from colibri.common.process.arguments import ArgumentParser


def add_options(parser: ArgumentParser) -> None:
    """Add the options of `colibri replay`."""
    add = parser.add_argument
    add(
        "log",
        type=Path,
        metavar="DIR|FLIGHT.ULG",
        help="folder of a flight, or its flight.ulg",
    )
    add("--quiet", action="store_true", help="say nothing but errors")


def run(args: Namespace) -> int:
    """Replay as the command line says; return the exit code."""
    from colibri.flights.replay import replay

    return replay(args)
