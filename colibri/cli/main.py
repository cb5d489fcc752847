"""`colibri`: the one command. Loads only what the subcommand needs."""

import signal
import sys
import threading
from argparse import Namespace
from collections.abc import Mapping, Sequence
from typing import Protocol

from colibri.cli import bench, compare, figures, fly, replay, sitl, study, verify
from colibri.cli.processes import PROCESSES, run_process
from colibri.common.errors import Error
from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.lifecycle import EXIT_FAILED, EXIT_INTERRUPTED, fail, use_one_thread


class Subcommand(Protocol):
    """A file of this folder: `HELP` is its line in `colibri --help`."""

    HELP: str

    def add_options(self, parser: ArgumentParser) -> None:
        """Add the options."""
        ...

    def run(self, args: Namespace) -> int:
        """Do what the options say; return the exit code."""
        ...


SUBCOMMANDS: Mapping[str, Subcommand] = {
    "fly": fly,
    "sitl": sitl,
    "figures": figures,
    "compare": compare,
    "study": study,
    "bench": bench,
    "replay": replay,
    "verify": verify,
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run a subcommand; return the exit code."""
    given = sys.argv[1:] if argv is None else argv
    if given and given[0] in PROCESSES:
        return run_process(given[0], given[1:])
    args = _parser().parse_args(given)
    use_one_thread()
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # so that what was started is ended, too
    try:
        return SUBCOMMANDS[args.command].run(args)
    except Error as error:
        fail(str(error), EXIT_FAILED)
    except KeyboardInterrupt:
        fail("interrupted", EXIT_INTERRUPTED)


def _parser() -> ArgumentParser:
    parser = ArgumentParser(prog="colibri", description="A quadrotor autopilot in pure Python, flown over MAVLink.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, subcommand in SUBCOMMANDS.items():
        subcommand.add_options(commands.add_parser(name, help=subcommand.HELP))
    for name, what in PROCESSES.items():
        commands.add_parser(name, help=what, add_help=False)
    return parser
