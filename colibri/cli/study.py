"""`colibri study`: its options, and its call."""

from argparse import Namespace
from pathlib import Path

from colibri.common.process.arguments import ArgumentParser


def add_options(parser: ArgumentParser) -> None:
    """Add the options of `colibri study`."""
    add = parser.add_argument
    add(
        "names",
        nargs="*",
        metavar="NAME",
        help="tracks, speed, recovery, robustness, limits or scheduling (default: all of them)",
    )
    add(
        "--out",
        type=Path,
        default=Path("out/study"),
        metavar="DIR",
        help="folder for figures and tables (default %(default)s)",
    )
    add("--quiet", action="store_true", help="say nothing but errors")


def run(args: Namespace) -> int:
    """Study as the command line says; return the exit code."""
    from colibri.studies.studies import study

    return study(args)
