"""The parser. Loads only the modules of requested subcommands."""

from argparse import Action, RawDescriptionHelpFormatter
from collections.abc import Generator, Sequence
from shutil import get_terminal_size
from textwrap import indent, wrap
from typing import NoReturn

from colibri.cli.commands import COMMANDS, GROUPS, PROCESSES
from colibri.common.process.arguments import ArgumentParser

_MIN_WIDTH, _MAX_WIDTH = 40, 120
_NAME = 18


class Version(Action):
    """Print the version, which takes time to find, and exit."""

    def __call__(self, *_: object) -> NoReturn:
        from importlib.metadata import version

        print(f"colibri {version('colibri-sitl')}")
        raise SystemExit(0)


class _Grouped(RawDescriptionHelpFormatter):
    """Help with the subcommands at the end only, in groups."""

    def _iter_indented_subactions(self, _action: Action) -> Generator[Action, None, None]:
        yield from ()


def parser_for(given: Sequence[str]) -> ArgumentParser:
    asked = next((word for word in given if word in COMMANDS), None)
    return parser_of(*(name for name in COMMANDS if name == asked))


def parser_of(*whole: str) -> ArgumentParser:
    """Return the parser with the options of some subcommands."""
    parser = ArgumentParser(
        prog="colibri",
        description="A quadrotor autopilot in pure Python, flown over MAVLink.",
        epilog=_listed(),
        formatter_class=_Grouped,
    )
    parser.add_argument("--version", action=Version, nargs=0, help="print the version")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", help="one of those below")
    for name, command in COMMANDS.items():
        examples = f"examples:\n{indent(command.examples, '  ')}"
        options = commands.add_parser(name, help=command.does, description=command.does, epilog=examples)
        options.formatter_class = RawDescriptionHelpFormatter
        if name in whole:
            add_options(name, options)
    for name, does in PROCESSES.items():
        commands.add_parser(name, help=does, add_help=False)
    return parser


def _listed() -> str:
    known = {group: {name: it.does for name, it in commands.items()} for group, commands in GROUPS.items()}
    width, lines = min(max(get_terminal_size().columns, _MIN_WIDTH), _MAX_WIDTH), []
    for group, commands in (known | {"the two processes of a flight": PROCESSES}).items():
        lines.append(f"{group}:")
        for name, does in commands.items():
            lines += wrap(does, width - 2, initial_indent=f"  {name:<{_NAME}}", subsequent_indent=" " * (_NAME + 2))
    return "\n".join([*lines, "", "colibri COMMAND --help says more of each."])


def add_options(name: str, parser: ArgumentParser) -> None:
    from colibri.cli import options  # the list of commands does without

    getattr(options, name.replace("-", "_"))(parser)
