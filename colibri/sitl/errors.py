"""The base of this package's errors."""

from colibri.common.errors import Error


class SitlError(Error):
    """A flight in a test or notebook fails."""
