"""What can be seen of a vehicle: conditions that hold or do not, with words for who reads that they do not."""

from collections.abc import Callable
from math import degrees, dist, hypot
from typing import NamedTuple

from colibri.autopilot.commander.rules.modes import Mode
from colibri.sitl.vehicle import Sitl


class Condition(NamedTuple):
    words: str
    holds: Callable[[Sitl], bool]


def height(up_m: float, within_m: float) -> Condition:
    return Condition(f"height {up_m:g} ± {within_m:g} m", lambda sitl: abs(sitl.position[2] - up_m) <= within_m)


def above(up_m: float) -> Condition:
    return Condition(f"above {up_m:g} m", lambda sitl: sitl.position[2] > up_m)


def below(up_m: float) -> Condition:
    return Condition(f"below {up_m:g} m", lambda sitl: sitl.position[2] < up_m)


def near(place: tuple[float, float, float], within_m: float) -> Condition:
    """It is near a place, ENU."""
    return Condition(f"within {within_m:g} m of {place}", lambda sitl: dist(sitl.position, place) <= within_m)


def over(east_m: float, north_m: float, within_m: float) -> Condition:
    return Condition(
        f"within {within_m:g} m of ({east_m:g}, {north_m:g})",
        lambda sitl: dist(sitl.position[:2], (east_m, north_m)) <= within_m,
    )


def away(from_home_m: float) -> Condition:
    """It is horizontally at least so far from where it began."""
    return Condition(f"{from_home_m:g} m from home", lambda sitl: hypot(*sitl.position[:2]) >= from_home_m)


def slower(m_s: float) -> Condition:
    return Condition(f"slower than {m_s:g} m/s", lambda sitl: sitl.speed_m_s < m_s)


def ground_speed(m_s: float, within_m_s: float) -> Condition:
    return Condition(
        f"{m_s:g} ± {within_m_s:g} m/s over ground", lambda sitl: abs(hypot(*sitl.velocity[:2]) - m_s) <= within_m_s
    )


def climbs(m_s: float, within_m_s: float) -> Condition:
    """It climbs at about that speed; less than 0 sinks."""
    return Condition(f"climbs at {m_s:g} ± {within_m_s:g} m/s", lambda sitl: abs(sitl.velocity[2] - m_s) <= within_m_s)


def tilted_less(deg: float) -> Condition:
    return Condition(f"tilt below {deg:g}°", lambda sitl: sitl.tilt_deg < deg)


def turns_slower(deg_s: float) -> Condition:
    return Condition(f"yaw rate below {deg_s:g}°/s", lambda sitl: abs(degrees(sitl.rates[2])) < deg_s)


def mode(name: Mode) -> Condition:
    return Condition(f"mode {name}", lambda sitl: sitl.mode is name)


ARMED = Condition("armed", lambda sitl: sitl.armed)
DISARMED = Condition("disarmed", lambda sitl: not sitl.armed)


def says(text: str) -> Condition:
    return Condition(f"says “{text}”", lambda sitl: sitl.said(text))


def quiet_about(text: str) -> Condition:
    return Condition(f"does not say “{text}”", lambda sitl: not sitl.said(text))


def every(*conditions: Condition) -> Condition:
    return Condition(", ".join(each.words for each in conditions), lambda sitl: all(c.holds(sitl) for c in conditions))
