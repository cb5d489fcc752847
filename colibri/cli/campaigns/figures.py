"""`colibri figures`."""

from argparse import Namespace

from colibri.cli.shared.options import add_out
from colibri.common.process.arguments import ArgumentParser


def add_options(parser: ArgumentParser) -> None:
    add_out(parser, "out/thesis", "PNG and SVG")
    parser.several("--only", "NUMBER", "only this figure, for example 4.9", default=None)


def run(args: Namespace) -> int:
    from colibri.studies.thesis_figures import figures

    return figures(args)
