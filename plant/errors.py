"""The base of this package's errors."""

from colibri.common.errors import Error


class PlantError(Error):
    """A vehicle that cannot be simulated, or no further."""
