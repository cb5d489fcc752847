"""`colibri replay`."""

from argparse import Namespace
from pathlib import Path

from colibri.common.process.arguments import ArgumentParser


def add_options(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add("log", type=Path, metavar="DIR|FLIGHT.ULG", help="folder of a flight, or its flight.ulg")
    add("--quiet", action="store_true", help="print errors only")


def run(args: Namespace) -> int:
    from colibri.flights.replay import replay

    return replay(args)
