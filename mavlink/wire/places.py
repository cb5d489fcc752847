"""Places in mission items, commands, setpoints and messages.

Latitude and longitude are given together or left out together; 0, 0 is invalid. An altitude is above sea level in
MAV_FRAME_GLOBAL (and _INT), above home in every other frame: without a terrain map the ground is flat.
"""

from math import hypot, isnan

from colibri.common.earth.geodesy import MAX_LATITUDE_DEG, MAX_LONGITUDE_DEG, Geodetic, enu_of
from colibri.common.types import Vector
from colibri.mavlink.wire.dialect import Refusal, mav

MAX_DISTANCE_M = 100_000.0  # from the origin: a place beyond is refused
FAR_M = 10_000.0  # from home: a place beyond is accepted with a warning, as in PX4 (MIS_DIST_1WP)
MAX_HEIGHT_M = 10_000.0

ABOVE_SEA: frozenset[int] = frozenset((mav.MAV_FRAME_GLOBAL, mav.MAV_FRAME_GLOBAL_INT))
ABOVE_TERRAIN: frozenset[int] = frozenset((mav.MAV_FRAME_GLOBAL_TERRAIN_ALT, mav.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT))
_COORDINATES = (("latitude", MAX_LATITUDE_DEG), ("longitude", MAX_LONGITUDE_DEG))


def misplaced(latitude_deg: float, longitude_deg: float) -> str:
    """Return the invalid coordinate, with value and valid range, or ""."""
    for (name, maximum), value in zip(_COORDINATES, (latitude_deg, longitude_deg), strict=True):
        if not abs(value) <= maximum:
            return f"{name} {value:.7g} is not within {maximum:g} degrees"
    return "" if latitude_deg or longitude_deg else "latitude 0, longitude 0 is not accepted"


def misplaced_height(altitude_m: float) -> str:
    return "" if abs(altitude_m) <= MAX_HEIGHT_M else f"altitude {altitude_m:g} is not within {MAX_HEIGHT_M:g} m"


def too_far(place: Vector, max_height_m: float = MAX_HEIGHT_M) -> str:
    """Return the distance of a place beyond the limit, and the limit, or ""."""
    east, north, up = place
    away_m = hypot(east, north)
    if not away_m <= MAX_DISTANCE_M:
        return f"{away_m / 1000.0:.0f} km away, more than {MAX_DISTANCE_M / 1000.0:.0f}"
    return "" if abs(up) < max_height_m else f"{up:.0f} m high, more than {max_height_m:.0f}"


def far(place: Vector, other: Vector) -> str:
    """Return how far one place is from another, if that may be a mistake, or ""."""
    away_m = hypot(place[0] - other[0], place[1] - other[1])
    return f"{away_m / 1000.0:.0f} km away" if away_m > FAR_M else ""


def height_m(altitude_m: float, frame: int, home_up_m: float, origin: Geodetic) -> float:
    """Return z of ENU, m, of an altitude in a frame."""
    return altitude_m - origin.altitude_m if frame in ABOVE_SEA else home_up_m + altitude_m


def read_place(
    latitude_deg: float,
    longitude_deg: float,
    altitude_m: float,
    frame: int,
    *,
    home_up_m: float,
    origin: Geodetic,
    here: Vector = (0.0, 0.0, 0.0),
) -> Vector | Refusal:
    """Return a place in ENU, m; what is nan is that of `here`."""
    x, y, z = here
    if not (isnan(latitude_deg) and isnan(longitude_deg)):
        wrong = misplaced(latitude_deg, longitude_deg)
        if wrong:
            return Refusal(wrong)
        x, y, _ = enu_of(Geodetic(latitude_deg, longitude_deg, 0.0), origin)
    if not isnan(altitude_m):
        z = height_m(altitude_m, frame, home_up_m, origin)
    place = (x, y, z)
    wrong = too_far(place)
    return Refusal(wrong) if wrong else place
