"""Static pressure and height in the troposphere of the standard atmosphere (ISO 2533)."""

_SEA_LEVEL_PA = 101325.0
_SEA_LEVEL_K = 288.15
_LAPSE_K_M = 0.0065
_EXPONENT = 8.31446261815324 / 0.0289644 * _LAPSE_K_M / 9.80665
"""R L / (M g)."""
METRES_PER_PASCAL = 0.0832
"""At sea level."""


def pressure_height_m(pressure_pa: float) -> float:
    """Return the height above mean sea level at which the standard atmosphere has this pressure (> 0)."""
    ratio: float = (pressure_pa / _SEA_LEVEL_PA) ** _EXPONENT
    return _SEA_LEVEL_K / _LAPSE_K_M * (1.0 - ratio)


def pressure_height_slope(pressure_pa: float) -> float:
    """Return its derivative, m/Pa."""
    ratio: float = (pressure_pa / _SEA_LEVEL_PA) ** _EXPONENT
    return -_SEA_LEVEL_K / _LAPSE_K_M * _EXPONENT * ratio / pressure_pa
