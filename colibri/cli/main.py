"""`colibri`: the one command. Loads only what the subcommand needs."""

import os
import signal
import sys
import threading
from argparse import Action, Namespace
from collections.abc import Sequence
from errno import EDQUOT, EFBIG, ENOSPC
from importlib import import_module
from typing import NoReturn, Protocol, cast

from colibri.cli.shared.processes import PROCESSES, run_process
from colibri.common.errors import Error
from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.lifecycle import (
    EXIT_FAILED,
    EXIT_INTERRUPTED,
    end_quickly,
    escape_what_no_stream_encodes,
    fail,
    loading,
    use_one_thread,
    use_safe_path,
)
from colibri.common.process.writable_folders import use_writable_folders

SUBCOMMANDS = {
    "fly": "fly a track and report how well it went",
    "sitl": "stand ready for ground stations: QGroundControl, MAVSDK, MAVProxy",
    "figures": "fly all that the thesis shows and draw its figures",
    "compare": "fly several controllers on several tracks, side by side",
    "campaign": "fly every combination of factors, by many seeds, into one table",
    "tune": "find better numbers of a profile, and what they are worth on seeds never seen",
    "study": "fly what shows how far profile flight reaches, and draw it",
    "check-controller": "try on a control law of your own what every one must satisfy",
    "certify": "prove what can be proven of a profile's attitude law",
    "bench": "measure how fast it flies",
    "view": "see flights, or a MAVLink vehicle, fly in a browser",
    "plot": "draw the figures of a flight, however it ended",
    "show": "print the file of a profile or vehicle, to copy and change",
    "vehicle": "write a vehicle as parameters of PX4 or ArduPilot",
    "replay": "feed a recorded flight to the autopilot: are its answers the same?",
    "verify": "fly a fixed set of flights: is every bit the same, twice, or as it once was?",
}
"""What each does, by its name, which is also that of its file beside this one; `_ROOMS` has those in rooms."""
_ROOMS = (
    dict.fromkeys(("campaign", "compare", "study", "figures"), "campaigns")
    | dict.fromkeys(("certify", "check-controller"), "laws")
    | dict.fromkeys(("show", "vehicle"), "descriptions")
    | {"view": "viewer"}
)
_NO_ROOM = (ENOSPC, EDQUOT, EFBIG)


class Subcommand(Protocol):
    """The file of a subcommand."""

    def add_options(self, parser: ArgumentParser) -> None:
        """Add its options."""

    def run(self, args: Namespace) -> int:
        """Do it; return the exit code."""


class Version(Action):
    """Prints the version that is installed, and ends."""

    def __call__(self, *_: object) -> NoReturn:
        """Look it up only now: that takes a while."""
        from importlib.metadata import version

        print(f"colibri {version('colibri-sitl')}")  # noqa: T201
        raise SystemExit(0)


def main(argv: list[str] | None = None) -> int:
    """Run a subcommand; return the exit code."""
    given = sys.argv[1:] if argv is None else argv
    escape_what_no_stream_encodes()
    _check_encoding(given)
    if given and given[0] in PROCESSES:
        return run_process(given[0], given[1:])
    use_one_thread()
    use_safe_path()
    end_quickly()
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # so that what was started is ended, too
    try:
        with loading():
            args, unknown = _parser(given).parse_known_args(given)
        if unknown:
            fail(f"unrecognized arguments: {' '.join(unknown)} (see colibri {args.command} --help)")
        use_writable_folders()
        code = subcommand(args.command).run(args)
        sys.stdout.flush()
        return code
    except Error as error:
        fail(str(error), EXIT_FAILED)
    except BrokenPipeError:  # nobody reads any more: `colibri show ... | head`
        _drop_what_cannot_be_printed()
        return EXIT_FAILED
    except OSError as error:
        if error.errno not in _NO_ROOM:
            raise
        _drop_what_cannot_be_printed()
        fail(f"cannot write {error.filename or 'to disk'}: {error.strerror}", EXIT_FAILED)
    except KeyboardInterrupt:
        fail("interrupted", EXIT_INTERRUPTED)


def _drop_what_cannot_be_printed() -> None:
    """Print the rest into the void where standard output takes no more: Python would report it again at its end."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _check_encoding(given: Sequence[str]) -> None:
    """End with one line where a word cannot be written to a log, which is UTF-8."""
    for word in given:
        try:
            word.encode()
        except UnicodeEncodeError:
            fail(f"{word} is not UTF-8 by this locale: rename the file, or try LC_ALL=C.UTF-8")


def _parser(given: Sequence[str]) -> ArgumentParser:
    """Return the parser of the whole command, with the options of the subcommand that is given alone."""
    parser = ArgumentParser(prog="colibri", description="A quadrotor autopilot in pure Python, flown over MAVLink.")
    parser.add_argument("--version", action=Version, nargs=0, help="print the version")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    asked = next((word for word in given if word in SUBCOMMANDS), None)
    for name, what in SUBCOMMANDS.items():
        options = commands.add_parser(name, help=what)
        if name == asked:
            subcommand(name).add_options(options)
    for name, what in PROCESSES.items():
        commands.add_parser(name, help=what, add_help=False)
    return parser


def subcommand(name: str) -> Subcommand:
    """Return the file of a subcommand."""
    room = f"colibri.cli.{_ROOMS[name]}" if name in _ROOMS else "colibri.cli"
    return cast(Subcommand, import_module(f"{room}.{name.replace('-', '_')}"))
