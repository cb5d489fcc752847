"""The base of this package's errors."""

from colibri.common.errors import Error


class MavlinkError(Error):
    """A link, a key or a file of MAVLink's that cannot be used."""
