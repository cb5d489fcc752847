"""`colibri study`."""

from argparse import Namespace

from colibri.cli.shared.options import add_out
from colibri.common.process.arguments import ArgumentParser


def add_options(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add(
        "names",
        nargs="*",
        metavar="NAME",
        help="tracks, speed, recovery, robustness, limits or scheduling (default: all of them)",
    )
    add_out(add, "out/study", "figures and tables")


def run(args: Namespace) -> int:
    from colibri.studies.studies import study

    return study(args)
