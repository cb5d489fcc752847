"""`colibri figures`."""

from argparse import Namespace

from colibri.cli.shared.options import add_out
from colibri.common.process.arguments import ArgumentParser


def add_options(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add_out(add, "out/thesis", "PNG and SVG")
    add("--only", action="append", metavar="NUMBER", help="only this figure, for example 4.9; may be repeated")


def run(args: Namespace) -> int:
    from colibri.studies.thesis_figures import figures

    return figures(args)
