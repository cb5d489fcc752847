"""The base of this package's errors."""

from colibri.common.errors import Error


class CompanionError(Error):
    """A companion that cannot begin, or what it was given and cannot fly."""
