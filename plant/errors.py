"""The base of this package's errors."""

from colibri.common.errors import Error


class PlantError(Error):
    """The vehicle cannot be simulated any further, or at all."""
