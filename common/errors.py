"""The base of every error that a user may see, and what its message says of a name that is unknown."""

from collections.abc import Iterable


class Error(Exception):
    """Something that a user can put right; the message is the one line of what, where and how.

    Below it is one base a package: `MavlinkError`, `PlantError`, `AutopilotError`, `SitlError`, `CompanionError`. What
    derives from none of them belongs to `common`, or to what a user runs. A mistake in this program is another
    exception, a traceback.
    """


class ForeignError(Error):
    """Code of another package raised what is its `__cause__`, whose traceback the author of that package needs."""


class InFlightError(Error):
    """A flight that was begun and came to no end, in whichever package; what was logged is there."""


def nearest(name: str, known: Iterable[str]) -> str:
    """Return the question whether the nearest of the known names was meant; empty where none is near."""
    from difflib import get_close_matches

    near = get_close_matches(name, list(known), 1)
    return f"did you mean {near[0]}?" if near else ""
