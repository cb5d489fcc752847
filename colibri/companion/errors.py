"""Base of this package's errors."""

from colibri.common.errors import Error


class CompanionError(Error):
    """The companion cannot begin with its input."""
