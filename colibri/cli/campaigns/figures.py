"""`colibri figures`."""

from argparse import Namespace

from colibri.cli.shared.options import add_out
from colibri.common.process.arguments import ArgumentParser


def add_options(parser: ArgumentParser) -> None:
    add = parser.value
    add_out(parser, "out/thesis", "PNG and SVG")
    add("--only", "NUMBER", "only this figure, for example 4.9; may be repeated", action="append")


def run(args: Namespace) -> int:
    from colibri.studies.thesis_figures import figures

    return figures(args)
