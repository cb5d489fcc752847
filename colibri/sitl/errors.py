"""The base of this package's errors."""

from colibri.common.errors import Error


class SitlError(Error):
    """A flight of a test or notebook cannot begin or go on, or fails."""
