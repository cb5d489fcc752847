"""`colibri study`."""

from argparse import Namespace

from colibri.cli.shared.options import add_out
from colibri.common.process.arguments import ArgumentParser


def add_options(parser: ArgumentParser) -> None:
    add = parser.value
    add("names", "NAME", "tracks, speed, recovery, robustness, limits or scheduling (default: all of them)", nargs="*")
    add_out(parser, "out/study", "figures and tables")


def run(args: Namespace) -> int:
    from colibri.studies.studies import study

    return study(args)
