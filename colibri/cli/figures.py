"""`colibri figures`: its options, and its call."""

from argparse import Namespace
from pathlib import Path

from colibri.common.process.arguments import ArgumentParser


def add_options(parser: ArgumentParser) -> None:
    """Add the options of `colibri figures`."""
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
    """Fly and draw as the command line says; return the exit code."""
    from colibri.studies.thesis_figures import figures

    return figures(args)
