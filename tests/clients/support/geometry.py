"""What a flight looked like: places, circles, ways; by what an observer has seen."""

from collections.abc import Sequence
from itertools import pairwise
from math import atan2, cos, hypot, pi, sin

from colibri.common.earth.geodesy import Geodetic, enu_of
from colibri.common.earth.home import DEFAULT_HOME
from colibri.common.types import Vector
from tools.harness.observer import Sight


def place(latitude_deg: float, longitude_deg: float, height_m: float) -> Vector:
    """Return a place in ENU, of a vehicle that began at the default home; `height_m` is above that."""
    x, y, _ = enu_of(Geodetic(latitude_deg, longitude_deg, DEFAULT_HOME.altitude_m), DEFAULT_HOME.origin)
    return (x, y, height_m)


def away_m(sight: Sight, where: Vector) -> float:
    return hypot(*(seen - wanted for seen, wanted in zip(sight.position_enu_m, where, strict=True)))


def closest_m(sights: Sequence[Sight], where: Vector) -> float:
    return min(away_m(sight, where) for sight in sights)


def turned_rad(angle: float) -> float:
    return atan2(sin(angle), cos(angle))


def swept_rad(sights: Sequence[Sight], center: Vector) -> float:
    """Return how far around a centre the vehicle went; counter-clockwise is positive."""
    angles = [atan2(s.position_enu_m[1] - center[1], s.position_enu_m[0] - center[0]) for s in sights]
    return sum(turned_rad(after - before) for before, after in pairwise(angles))


def heading_deg(sight: Sight) -> float:
    return turned_rad(0.5 * pi - sight.euler_rad[2]) * 180.0 / pi


def speed_m_s(sight: Sight) -> float:
    return hypot(*sight.velocity_enu_m_s[:2])


def during(sights: Sequence[Sight], start_s: float, end_s: float) -> list[Sight]:
    return [sight for sight in sights if start_s <= sight.time_s <= end_s]
