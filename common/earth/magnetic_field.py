"""The earth's magnetic field: the World Magnetic Model 2025, https://www.ncei.noaa.gov/products/world-magnetic-model."""

from functools import lru_cache

from pygeomag import GeoMag
from pygeomag.wmm.wmm_2025 import WMM_2025

from colibri.common.earth.geodesy import Geodetic
from colibri.common.types import Vector

YEAR = 2026.0  # fixed, so that flights are repeatable; the model is valid from 2025 to 2030

_GAUSS_PER_NT = 1e-5
_DECIMALS_NT = 6
_MIN_HEIGHT_KM, _MAX_HEIGHT_KM = -1.0, 850.0


@lru_cache(maxsize=64)
def field_enu_gauss(place: Geodetic, year: float = YEAR) -> Vector:
    """Return the field in ENU of true north; the altitude is clamped to -1 to 850 km."""
    altitude_km = min(max(place.altitude_m / 1e3, _MIN_HEIGHT_KM), _MAX_HEIGHT_KM)
    model = GeoMag(coefficients_data=WMM_2025)
    field = model.calculate(place.latitude_deg, place.longitude_deg, altitude_km, year)
    return (_gauss(field.y), _gauss(field.x), _gauss(-field.z))


def _gauss(field_nt: float) -> float:
    return round(field_nt, _DECIMALS_NT) * _GAUSS_PER_NT
