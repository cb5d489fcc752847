"""Latitude and longitude ⇄ metres east and north: PX4's azimuthal equidistant projection of a sphere."""

from collections.abc import Callable
from math import degrees, hypot, radians
from typing import NamedTuple

from colibri.common.elementary import acos, asin, atan2, cos, sin
from colibri.common.types import Vector

EARTH_RADIUS_M = 6371000.0
MAX_LATITUDE_DEG = 90.0
MAX_LONGITUDE_DEG = 180.0


class Geodetic(NamedTuple):
    """A place on earth; the altitude is above mean sea level."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float


DEFAULT_ORIGIN = Geodetic(47.397742, 8.545594, 488.0)  # Zurich, Irchel: the usual origin of PX4's simulators


def is_on_earth(latitude_deg: float, longitude_deg: float) -> bool:
    return abs(latitude_deg) <= MAX_LATITUDE_DEG and abs(longitude_deg) <= MAX_LONGITUDE_DEG


def offset_m(
    latitude_deg: float, longitude_deg: float, first_latitude_deg: float, first_longitude_deg: float
) -> tuple[float, float]:
    latitude, first = radians(latitude_deg), radians(first_latitude_deg)
    along = radians(longitude_deg - first_longitude_deg)
    cosine = sin(first) * sin(latitude) + cos(first) * cos(latitude) * cos(along)
    angle = acos(max(-1.0, min(1.0, cosine)))
    scale = EARTH_RADIUS_M * (angle / sin(angle) if sin(angle) > 0.0 else 1.0)
    north = cos(first) * sin(latitude) - sin(first) * cos(latitude) * cos(along)
    east = cos(latitude) * sin(along)
    return scale * east, scale * north


def place_deg(
    east_m: float, north_m: float, distance_m: float, first_latitude_deg: float, first_longitude_deg: float
) -> tuple[float, float]:
    """Return latitude and longitude of an offset with positive length `distance_m`."""
    angle, first = distance_m / EARTH_RADIUS_M, radians(first_latitude_deg)
    latitude = asin(cos(angle) * sin(first) + north_m * sin(angle) * cos(first) / distance_m)
    longitude = radians(first_longitude_deg) + atan2(
        east_m * sin(angle), distance_m * cos(first) * cos(angle) - north_m * sin(first) * sin(angle)
    )
    return degrees(latitude), (degrees(longitude) + 180.0) % 360.0 - 180.0


def enu_of(place: Geodetic, origin: Geodetic, *, offset: Callable[..., tuple[float, float]] = offset_m) -> Vector:
    east, north = offset(place.latitude_deg, place.longitude_deg, origin.latitude_deg, origin.longitude_deg)
    return (east, north, place.altitude_m - origin.altitude_m)


def geodetic_of(
    position_enu_m: Vector, origin: Geodetic, *, place: Callable[..., tuple[float, float]] = place_deg
) -> Geodetic:
    east, north, up = position_enu_m
    distance = hypot(east, north)
    latitude_deg, longitude_deg, altitude_m = origin
    if distance != 0.0:
        latitude_deg, longitude_deg = place(east, north, distance, latitude_deg, longitude_deg)
    return Geodetic(latitude_deg, longitude_deg, altitude_m + up)
