"""The base of this package's errors."""

from colibri.common.errors import Error


class AutopilotError(Error):
    """A profile, control law, solver, track, parameter or stored state is unusable."""
