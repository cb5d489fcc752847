"""The base of all errors shown to users, and the message for an unknown name."""

from collections.abc import Iterable


class Error(Exception):
    """Something that a user can put right; the message is the one line of what, where and how.

    Each package has a base below it: `MavlinkError`, `PlantError`, `AutopilotError`, `SitlError`, `CompanionError`. A
    mistake in this program is another exception, with a traceback.
    """


class ForeignError(Error):
    """An exception of another package's code, `__cause__`, shown with its traceback."""


class InFlightError(Error):
    """A flight that was begun and could not be finished; its logs are kept."""


def unknown(what: str, given: object, known: Iterable[str]) -> str:
    """Return the message for an unknown name, with the closest match or all valid names."""
    from difflib import get_close_matches

    names = [str(name) for name in known]
    near = get_close_matches(str(given), names, 1)
    hint = f'did you mean "{near[0]}"?' if near else f"choose {', '.join(names)}"
    return f'unknown {what} "{given}" ({hint})'
