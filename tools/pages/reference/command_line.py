"""`cli.md`: every command and option, from the parsers."""

import re
from argparse import SUPPRESS, Action, ArgumentParser, HelpFormatter
from collections.abc import Iterator

from colibri.autopilot.__main__ import command_line as autopilot_command_line
from colibri.cli.commands import COMMANDS, GROUPS, PROCESSES, parser_of
from colibri.plant.__main__ import command_line as plant_command_line
from tools.pages.tables import with_body


class _Listener(HelpFormatter):
    """Records the arguments of a parser, without formatting them."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog)
        self.heard: list[Action] = []

    def add_argument(self, action: Action) -> None:
        self.heard.append(action)


def arguments_of(parser: ArgumentParser) -> list[Action]:
    """Return arguments in the order of the help."""
    listener = _Listener(parser.prog)
    parser.formatter_class = lambda prog: listener  # noqa: ARG005
    parser.format_help()
    return [action for action in listener.heard if action.help != SUPPRESS]


def parsers() -> dict[str, ArgumentParser]:
    whole = parser_of(*COMMANDS)
    (commands,) = [action.choices for action in arguments_of(whole) if isinstance(action.choices, dict)]
    found = {name: commands[name] for name in COMMANDS}
    return {**found, "plant": plant_command_line(), "autopilot": autopilot_command_line()}


def _page() -> Iterator[str]:
    for group, names in (*GROUPS.items(), ("the two processes of a flight", tuple(PROCESSES))):
        yield f"- **{group}**: " + ", ".join(f"[`{name}`](#colibri-{name})" for name in names)
    yield ""
    told: dict[str, tuple[str, str]] = {}
    for name, parser in parsers().items():
        yield from _section(name, parser, told)


def _rows(parser: ArgumentParser) -> Iterator[tuple[str, str]]:
    """Yield the name of each option, and its row."""
    for action in arguments_of(parser):
        if action.dest != "help":
            name = action.option_strings[0] if action.option_strings else action.dest
            yield name, f"- `{_names(action)}`: {_help(action, parser)}"


def _split(row: str) -> tuple[str, str]:
    """Return a row without its default, and that."""
    default = re.search(r" \(default:? [^()]+\)", row)
    return (row.replace(default[0], ""), default[0]) if default else (row, "")


def _section(name: str, parser: ArgumentParser, told: dict[str, tuple[str, str]]) -> Iterator[str]:
    """Yield a section; `told` has earlier rows, with commands and defaults."""
    does = COMMANDS[name].does if name in COMMANDS else PROCESSES[name]
    yield f"## colibri {name}\n"
    yield f"{does[0].upper()}{does[1:]}.\n"
    if name in COMMANDS:
        yield f"```sh\n{COMMANDS[name].examples}\n```\n"
    shared: dict[str, list[str]] = {}
    for option, row in _rows(parser):
        plain, default = _split(row)
        command, usual = told.setdefault(plain, (name, default))
        if command == name:
            yield row
        else:
            shared.setdefault(command, []).append(f"`{option}`{default if default != usual else ''}")
    yield ""
    if shared:
        yield " ".join(f"As in [`{of}`](#colibri-{of}): {', '.join(same)}." for of, same in shared.items()) + "\n"


def _names(action: Action) -> str:
    values = action.metavar
    if values is None and action.choices is not None:
        values = "|".join(map(str, action.choices))
    if values is None and action.nargs != 0:
        values = action.dest.upper()
    shown = " ".join(values) if isinstance(values, tuple) else str(values or "")
    return " ".join(filter(None, [", ".join(action.option_strings), shown]))


def _help(action: Action, parser: ArgumentParser) -> str:
    values = {**vars(action), "prog": parser.prog}
    said = (action.help or "") % values
    return " ".join(said.split()).replace("<", "&lt;").replace("*", "\\*")


PAGES = {"cli.md": lambda page: with_body(page, _page(), first="- **", last="## Environment")}
