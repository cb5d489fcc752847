"""The base of every error that a user may see."""


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
