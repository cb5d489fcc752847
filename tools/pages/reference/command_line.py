"""`cli.md`: every command and option, from the parsers."""

from argparse import SUPPRESS, Action, ArgumentParser, HelpFormatter
from collections.abc import Iterator
from textwrap import dedent

from colibri.autopilot.__main__ import command_line as autopilot_command_line
from colibri.cli.shared.commands import COMMANDS, GROUPS, PROCESSES
from colibri.cli.shared.parser import parser_of
from colibri.plant.__main__ import command_line as plant_command_line
from tools.pages.tables import code, with_body


class _Listener(HelpFormatter):
    """Records the arguments of a parser, without formatting them."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog)
        self.heard: list[Action] = []

    def add_argument(self, action: Action) -> None:
        self.heard.append(action)


def arguments_of(parser: ArgumentParser) -> list[Action]:
    """Return the arguments of a parser in the order of its help."""
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
    every = parsers()
    of_fly = {row for _, row in _rows(every["fly"])}
    for name, parser in every.items():
        yield from _section(name, parser, of_fly if name != "fly" else set())


def _rows(parser: ArgumentParser) -> Iterator[tuple[str, str]]:
    """Yield the name of each option, and its row."""
    for action in arguments_of(parser):
        if action.dest != "help":
            name = action.option_strings[0] if action.option_strings else action.dest
            yield name, f"| {_names(action)} | {_help(action, parser)} |"


def _section(name: str, parser: ArgumentParser, of_fly: set[str]) -> Iterator[str]:
    does = COMMANDS[name].does if name in COMMANDS else PROCESSES[name]
    yield f"## colibri {name}\n"
    yield f"{does[0].upper()}{does[1:]}.\n"
    if name in COMMANDS:
        yield f"```sh\n{dedent(COMMANDS[name].examples).strip()}\n```\n"
    yield "| | |\n|---|---|"
    rows = list(_rows(parser))
    yield from (row for _, row in rows if row not in of_fly)
    yield ""
    if shared := [f"`{option}`" for option, row in rows if row in of_fly]:
        yield f"As in [`fly`](#colibri-fly): {', '.join(shared)}.\n"


def _names(action: Action) -> str:
    values = action.metavar
    if values is None and action.choices is not None:
        values = "|".join(map(str, action.choices))
    if values is None and action.nargs != 0:
        values = action.dest.upper()
    shown = " ".join(values) if isinstance(values, tuple) else str(values or "")
    return code(" ".join(filter(None, [", ".join(action.option_strings), shown])))


def _help(action: Action, parser: ArgumentParser) -> str:
    values = {**vars(action), "prog": parser.prog}
    said = (action.help or "") % values
    return " ".join(said.split()).replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*")


PAGES = {"cli.md": lambda page: with_body(page, _page(), first="- **", last="## Environment")}
