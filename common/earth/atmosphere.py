"""The standard atmosphere below 11 km: pressure ⇄ altitude above mean sea level (ICAO Doc 7488; ISO 2533)."""

from colibri.common.kernels import power

_SEA_LEVEL_PA = 101_325.0
_SEA_LEVEL_K = 288.15
_LAPSE_K_M = 0.0065
_EXPONENT = 9.80665 / (287.05287 * _LAPSE_K_M)
_ZERO_CELSIUS_K = 273.15
METRES_PER_PASCAL = 0.0832  # at sea level


def pressure_pa(altitude_m: float) -> float:
    return _SEA_LEVEL_PA * power(max(0.0, 1.0 - _LAPSE_K_M * altitude_m / _SEA_LEVEL_K), _EXPONENT)


def altitude_m(pressure_pa: float) -> float:
    """Return the altitude of a static pressure; negative counts as 0."""
    return _SEA_LEVEL_K / _LAPSE_K_M * (1.0 - power(max(0.0, pressure_pa) / _SEA_LEVEL_PA, 1.0 / _EXPONENT))


def altitude_slope_m_pa(pressure_pa: float) -> float:
    """Return the derivative of `altitude_m`, m/Pa, at a positive pressure."""
    ratio = power(pressure_pa / _SEA_LEVEL_PA, 1.0 / _EXPONENT)
    return -_SEA_LEVEL_K / _LAPSE_K_M * ratio / (_EXPONENT * pressure_pa)


def temperature_c(altitude_m: float) -> float:
    return _SEA_LEVEL_K - _LAPSE_K_M * altitude_m - _ZERO_CELSIUS_K
