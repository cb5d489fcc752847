"""Latitude and longitude ⇄ metres east and north of an origin: the azimuthal equidistant projection of a sphere.

The projection and the radius are those that PX4 and the ground stations that fly it use, so that both sides put a
waypoint on the same spot. Altitude is not projected: z is the height above the origin's.
"""

from functools import lru_cache
from math import degrees, hypot, isfinite, radians
from typing import NamedTuple

from colibri.common.elementary import acos, asin, atan2, cos, sin
from colibri.common.types import Vector

EARTH_RADIUS_M = 6371000.0
MAX_LATITUDE_DEG = 90.0
MAX_LONGITUDE_DEG = 180.0


class Geodetic(NamedTuple):
    """A place on earth; its altitude is above mean sea level."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float


DEFAULT_ORIGIN = Geodetic(47.397742, 8.545594, 488.0)
"""Where simulated vehicles of this kind have always flown: Zurich, Irchel."""


def is_on_earth(latitude_deg: float, longitude_deg: float) -> bool:
    """Whether these can be a latitude and a longitude, degrees."""
    return (
        isfinite(latitude_deg)
        and isfinite(longitude_deg)
        and abs(latitude_deg) <= MAX_LATITUDE_DEG
        and abs(longitude_deg) <= MAX_LONGITUDE_DEG
    )


def enu_of(place: Geodetic, origin: Geodetic) -> Vector:
    """Return where `place` is seen from `origin`, m, ENU."""
    latitude, first = radians(place.latitude_deg), radians(origin.latitude_deg)
    along = radians(place.longitude_deg - origin.longitude_deg)
    cosine = sin(first) * sin(latitude) + cos(first) * cos(latitude) * cos(along)
    angle = acos(max(-1.0, min(1.0, cosine)))
    scale = EARTH_RADIUS_M * (angle / sin(angle) if sin(angle) > 0.0 else 1.0)
    north = cos(first) * sin(latitude) - sin(first) * cos(latitude) * cos(along)
    east = cos(latitude) * sin(along)
    return (scale * east, scale * north, place.altitude_m - origin.altitude_m)


def geodetic_of(position_enu_m: Vector, origin: Geodetic) -> Geodetic:
    """Return the place at `position_enu_m` from `origin`."""
    east, north, up = position_enu_m
    distance = hypot(east, north)
    if distance == 0.0:
        return origin._replace(altitude_m=origin.altitude_m + up)
    angle = distance / EARTH_RADIUS_M
    sine, cosine = sin(angle), cos(angle)
    first_sine, first_cosine = _sine_and_cosine(origin.latitude_deg)
    latitude = asin(cosine * first_sine + north * sine * first_cosine / distance)
    longitude = radians(origin.longitude_deg) + atan2(
        east * sine, distance * first_cosine * cosine - north * first_sine * sine
    )
    wrapped = (degrees(longitude) + 180.0) % 360.0 - 180.0
    return Geodetic(degrees(latitude), wrapped, origin.altitude_m + up)


@lru_cache(maxsize=64)
def _sine_and_cosine(angle_deg: float) -> tuple[float, float]:
    angle = radians(angle_deg)
    return sin(angle), cos(angle)
