"""`colibri replay`."""

from argparse import Namespace
from pathlib import Path

from colibri.common.process.arguments import ArgumentParser


def add_options(parser: ArgumentParser) -> None:
    add = parser.value
    add("log", "DIR|FLIGHT.ULG", "folder of a flight, or its flight.ulg", type=Path)
    parser.flag("--quiet", "print errors only")


def run(args: Namespace) -> int:
    from colibri.flights.replay import replay

    return replay(args)
