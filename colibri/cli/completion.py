"""`colibri completion`."""

import re
from argparse import Action, Namespace, _SubParsersAction
from collections.abc import Callable, Sequence

from shtab import DIRECTORY, FILE, complete

from colibri.autopilot.__main__ import command_line as autopilot
from colibri.autopilot.control.profile import profile_names
from colibri.autopilot.control.registry import controller_names
from colibri.autopilot.guidance.trajectories.registry import track_names
from colibri.cli.commands import COMMANDS, parser_of
from colibri.common.process.arguments import ArgumentParser
from colibri.plant.__main__ import command_line as plant
from colibri.plant.vehicle.description import vehicle_names

_NAMES: dict[str, Callable[[], Sequence[str]]] = {
    **dict.fromkeys(("track", "tracks"), track_names),
    "profile": profile_names,
    **dict.fromkeys(("controller", "check-controller"), controller_names),
    **dict.fromkeys(("vehicle", "plant_vehicle", "model"), vehicle_names),
    "show": lambda: [*profile_names(), *vehicle_names()],
}
"""Functions to the known values, by argument or command."""


def completion(args: Namespace) -> int:
    print(complete(completed_parser(), args.shell))
    return 0


def completed_parser() -> ArgumentParser:
    """Return a parser with all possible values of arguments."""
    parser = parser_of(*COMMANDS)
    (commands,) = (action for action in parser._actions if isinstance(action, _SubParsersAction))  # noqa: SLF001
    commands.choices.update(plant=plant(), autopilot=autopilot())
    for command, options in commands.choices.items():
        for action in options._actions:  # noqa: SLF001
            _complete(action, command)
    return parser


def _complete(action: Action, command: str) -> None:
    metavar = action.metavar if isinstance(action.metavar, str) else ""
    named = command if action.dest == "name" and not action.option_strings else action.dest
    if action.nargs == 0 or action.choices is not None:
        return
    if metavar in ("NAME", "TRACK", "PROFILE") and named in _NAMES:
        action.choices = _NAMES[named]()
    elif re.fullmatch(r"[a-z0-9-]+(\|[a-z0-9-]+)+", metavar):
        action.choices = metavar.split("|")
    elif metavar in ("DIR", "FOLDER"):
        action.complete = DIRECTORY  # type: ignore[attr-defined]
    elif re.search("FILE|FOLDER|TLOG", metavar):
        action.complete = FILE  # type: ignore[attr-defined]
