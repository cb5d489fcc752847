"""The base of this package's errors."""

from colibri.common.errors import Error


class AutopilotError(Error):
    """What cannot be flown: a profile, a control law, a solver, a track, parameters, what was kept."""
