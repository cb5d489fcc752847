"""`colibri compile`."""

from argparse import Namespace

from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.lifecycle import loading


def add_options(parser: ArgumentParser) -> None:
    parser.add_argument("what", nargs="*", help="flight, thesis, sensors, path, tests (default all of them)")
    parser.flag("--quiet", "print errors only")


def run(args: Namespace) -> int:
    with loading():
        from colibri.cli.computer.first_flights import compile_all

    return compile_all(args.what, quiet=args.quiet)
