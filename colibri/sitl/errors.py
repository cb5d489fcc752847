"""The base of this package's errors."""

from colibri.common.errors import Error


class SitlError(Error):
    """A flight of a test or a notebook that cannot begin, cannot go on, or does not do what is asked for."""
