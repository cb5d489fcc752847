"""The error of a learning environment."""

from colibri.common.errors import Error


class GymError(Error):
    """An environment cannot be made or stepped as requested."""


class GymImportError(GymError, ImportError):
    """A package of the extra `gym` is missing."""
