"""`colibri completion`: its options, and its call."""

from argparse import Namespace

from colibri.common.process.arguments import ArgumentParser

SHELLS = ("bash", "zsh", "fish", "tcsh", "powershell")


def add_options(parser: ArgumentParser) -> None:
    """Add the options of `colibri completion`."""
    parser.add_argument("shell", choices=SHELLS, help="whose; where the script goes is in the examples")


def run(args: Namespace) -> int:
    """Print the script by which a shell completes every command; return the exit code."""
    from shtab import complete

    from colibri.cli.shared.commands import COMMANDS
    from colibri.cli.shared.parser import parser_of

    print(complete(parser_of(*COMMANDS), args.shell))  # noqa: T201
    return 0
