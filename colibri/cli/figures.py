"""`colibri figures`: its options and its call."""

from argparse import Namespace
from pathlib import Path

from colibri.common.process.arguments import ArgumentParser

HELP = "fly all that the thesis shows and draw its figures"


def add_options(parser: ArgumentParser) -> None:
    """Add the options."""
    add = parser.add_argument
    add(
        "--out",
        type=Path,
        default=Path("out/thesis"),
        metavar="DIR",
        help="folder for PNG and SVG (default %(default)s)",
    )
    add("--only", action="append", metavar="NUMBER", help="only this figure, 4.9 say; may be repeated")
    add("--quiet", action="store_true", help="say nothing but errors")


def run(args: Namespace) -> int:
    """Do it; return the exit code."""
    from colibri.studies.thesis_figures import figures

    return figures(args)
