"""`colibri study`: its options and its call."""

from argparse import Namespace
from pathlib import Path

from colibri.common.process.arguments import ArgumentParser

HELP = "fly what shows how far profile flight reaches, and draw it"


def add_options(parser: ArgumentParser) -> None:
    """Add the options."""
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
    """Do it; return the exit code."""
    from colibri.studies.studies import study

    return study(args)
