"""The command line, run in this process, and files to hand to it."""

import signal
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, TypeAlias

from colibri.cli.main import main
from colibri.common.process.lifecycle import ENDINGS

VEHICLE = Path(__file__).parents[2] / "plant" / "vehicle" / "models" / "hummingbird.toml"
PROFILE = Path(__file__).parents[2] / "autopilot" / "profiles" / "thesis.toml"
FLIGHT = PROFILE.with_name("flight.toml")


class Said(NamedTuple):
    out: str
    err: str


Ran: TypeAlias = Callable[..., Said]
"""(words of a command, code=exit code) -> what it says."""
Refused: TypeAlias = Callable[..., str]
"""(words of a command that is refused, code=exit code) -> the one line that it says, without `colibri: error: `."""


def edited(folder: Path, source: Path, old: str, new: str) -> str:
    """Write a copy of a file to `folder`, with one change; return its path."""
    text = source.read_text(encoding="utf-8")
    assert text.count(old) == 1
    path = folder / source.name
    path.write_text(text.replace(old, new), encoding="utf-8")
    return str(path)


def exit_code(command: list[str]) -> int | str | None:
    """Run a command, and restore the handlers of signals: later child processes would inherit ignored ones."""
    handlers = {number: signal.getsignal(number) for number in ENDINGS}
    try:
        return main(command)
    except SystemExit as ended:
        return ended.code
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
