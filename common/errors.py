"""The base of all errors shown to users, and the message for an unknown name."""

from collections.abc import Iterable


class Error(Exception):
    """Something that a user can put right; the message is the one line of what, where and how.

    Below it is one base a package: `MavlinkError`, `PlantError`, `AutopilotError`, `SitlError`, `CompanionError`. What
    derives from none of them belongs to `common`, or to what a user runs. A mistake in this program is another
    exception, a traceback.
    """


class ForeignError(Error):
    """An exception in code of another package, kept as `__cause__` with the traceback for its author."""


class InFlightError(Error):
    """A flight that was begun and came to no end, in whichever package; what was logged is there."""


def unknown(what: str, given: object, known: Iterable[str]) -> str:
    """Return the message for an unknown name, with the closest match or all valid names."""
    from difflib import get_close_matches

    names = [str(name) for name in known]
    near = get_close_matches(str(given), names, 1)
    hint = f'did you mean "{near[0]}"?' if near else f"choose {', '.join(names)}"
    return f'unknown {what} "{given}" ({hint})'
