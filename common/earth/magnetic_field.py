"""The earth's magnetic field at a place: the World Magnetic Model 2025 of NOAA and the British Geological Survey.

https://www.ncei.noaa.gov/products/world-magnetic-model
"""

from functools import lru_cache

from pygeomag import GeoMag
from pygeomag.wmm.wmm_2025 import WMM_2025

from colibri.common.earth.geodesy import Geodetic
from colibri.common.types import Vector

YEAR = 2026.0
"""Of the model, which is good from 2025 to 2030: no clock is asked, so that a flight can be flown again."""

_GAUSS_PER_NT = 1e-5
_DECIMALS_NT = 6
_MIN_HEIGHT_KM, _MAX_HEIGHT_KM = -1.0, 850.0


@lru_cache(maxsize=64)
def field_enu_gauss(place: Geodetic, year: float = YEAR) -> Vector:
    """Return the magnetic field at `place`, gauss, ENU of true north.

    Args:
        place: On earth; its altitude is taken within what the model is made for, -1 to 850 km.
        year: Decimal year, 2025 to 2030.
    """
    altitude_km = min(max(place.altitude_m / 1e3, _MIN_HEIGHT_KM), _MAX_HEIGHT_KM)
    field = GeoMag(coefficients_data=WMM_2025).calculate(
        glat=place.latitude_deg, glon=place.longitude_deg, alt=altitude_km, time=year
    )
    return (_gauss(field.y), _gauss(field.x), _gauss(-field.z))


def _gauss(field_nt: float) -> float:
    """Return a component in gauss, rounded far below the model's accuracy: libm's last bits differ by computer."""
    return round(field_nt, _DECIMALS_NT) * _GAUSS_PER_NT
