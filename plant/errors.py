"""The base of this package's errors."""

from colibri.common.errors import Error


class PlantError(Error):
    """The vehicle cannot be simulated, or not any further."""
