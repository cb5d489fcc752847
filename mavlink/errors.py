"""The base of this package's errors."""

from colibri.common.errors import Error


class MavlinkError(Error):
    """An unusable link, key or MAVLink file."""
