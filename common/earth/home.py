"""Home of a vehicle: LAT,LON,ALT,YAW of the command line."""

from argparse import ArgumentTypeError
from typing import NamedTuple

from colibri.common.earth.geodesy import DEFAULT_ORIGIN, Geodetic, is_on_earth

_MIN_HEIGHT_M, _MAX_HEIGHT_M = -500.0, 10_000.0


class HomePlace(NamedTuple):
    """Initial place of the vehicle, and origin of the ENU frame."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float  # above mean sea level
    yaw_deg: float  # clockwise from north

    @property
    def origin(self) -> Geodetic:
        return Geodetic(self.latitude_deg, self.longitude_deg, self.altitude_m)

    @property
    def yaw_enu_deg(self) -> float:
        """Heading, counter-clockwise from east."""
        return 90.0 - self.yaw_deg

    def __str__(self) -> str:
        return ",".join(map(repr, self))


DEFAULT_HOME = HomePlace(*DEFAULT_ORIGIN, 0.0)


def home(text: str) -> HomePlace:
    try:
        place = HomePlace(*map(float, text.split(",")))
    except (TypeError, ValueError):
        raise ArgumentTypeError(f"expected LAT,LON,ALT,YAW in degrees and metres, not {text}") from None
    if not is_on_earth(place.latitude_deg, place.longitude_deg):
        raise ArgumentTypeError(f"not a latitude of -90 to 90 and a longitude of -180 to 180: {text}")
    if not (_MIN_HEIGHT_M <= place.altitude_m <= _MAX_HEIGHT_M and abs(place.yaw_deg) <= 360.0):
        raise ArgumentTypeError(f"not an altitude of -500 to 10000 m and a yaw of -360 to 360 degrees: {text}")
    return place
