"""Frames of other autopilots, and their numbering of a vehicle's rotors.

PX4 and ArduPilot number alike. Sources: PX4 Airframes Reference; ArduPilot, AP_MotorsMatrix.cpp.
"""

from collections.abc import Sequence
from math import degrees
from typing import NamedTuple

from colibri.common.elementary import atan2
from colibri.common.types import PerRotor

_NEAR_DEG = 20.0
_FULL_TURN_DEG = 360.0


class Place(NamedTuple):
    bearing_deg: float  # clockwise from the front
    direction: str  # as in vehicle files
    level: int = 0  # 1 above, -1 below a motor of the same bearing


class Frame(NamedTuple):
    ardupilot: tuple[int, int]  # FRAME_CLASS and FRAME_TYPE
    reversed_type: int | None  # FRAME_TYPE if all motors turn the other way
    motors: tuple[Place, ...]


def _motors(bearings_deg: Sequence[float], directions: str, levels: str = "") -> tuple[Place, ...]:
    """Return motors that turn clockwise (c) or the other way (t), above (a) or below (b) others."""
    spins = ("cw" if letter == "c" else "ccw" for letter in directions)
    heights = ({"a": 1, "b": -1}[letter] for letter in levels or "a" * len(directions))
    return tuple(map(Place, bearings_deg, spins, heights if levels else (0,) * len(directions)))


FRAMES: dict[str, Frame] = {
    "+": Frame((1, 0), 6, _motors((90.0, -90.0, 0.0, 180.0), "ttcc")),
    "x": Frame((1, 1), 3, _motors((45.0, -135.0, -45.0, 135.0), "ttcc")),
    "hexa-+": Frame((2, 0), None, _motors((0.0, 180.0, -120.0, 60.0, -60.0, 120.0), "ctcttc")),
    "hexa-x": Frame((2, 1), None, _motors((90.0, -90.0, -30.0, 150.0, 30.0, -150.0), "ctcttc")),
    "octo-+": Frame((3, 0), None, _motors((0.0, 180.0, 45.0, 135.0, -45.0, -135.0, -90.0, 90.0), "ccttttcc")),
    "octo-x": Frame((3, 1), None, _motors((22.5, -157.5, 67.5, 157.5, -22.5, -112.5, -67.5, 112.5), "ccttttcc")),
    "x8": Frame((4, 1), None, _motors((45, -45, -135, 135, -45, 45, 135, -135), "tctctctc", "aaaabbbb")),
    "y6": Frame((5, 10), None, _motors((60.0, 60.0, 180.0, 180.0, -60.0, -60.0), "ctctct", "ababab")),
}
"""By layout. A reversed x is ArduPilot's H, a y6 its Y6B."""


class Numbering(NamedTuple):
    """Rotor order of PX4 and ArduPilot: for each of their motors, the index in the vehicle file."""

    shape: str  # of `FRAMES`; empty: none of them
    reverse: bool
    rotors: tuple[int, ...]

    def to_vehicle(self, motors: PerRotor) -> PerRotor:
        given = [0.0] * len(self.rotors)
        for rotor, motor in zip(self.rotors, motors, strict=True):
            given[rotor] = motor
        return tuple(given)

    def to_motors(self, rotors: PerRotor) -> PerRotor:
        return tuple([rotors[rotor] for rotor in self.rotors])

    @property
    def ardupilot_frame(self) -> tuple[int, int]:
        """FRAME_CLASS and FRAME_TYPE."""
        kind, usual = FRAMES[self.shape].ardupilot
        reverse = FRAMES[self.shape].reversed_type
        return kind, usual if not self.reverse or reverse is None else reverse


def numbering(position_m: Sequence[tuple[float, ...]], direction: Sequence[str]) -> Numbering | None:
    """Return the numbering; None if the rotors are none of `FRAMES`, or do not turn as in one."""
    bearings_deg = [degrees(atan2(-y, x)) for x, y, *_ in position_m]
    heights_m = [place[2] if len(place) > 2 else 0.0 for place in position_m]
    for shape, frame in FRAMES.items():
        if len(frame.motors) != len(position_m):
            continue
        found = [_rotors_at(motor, bearings_deg, heights_m) for motor in frame.motors]
        if not all(len(rotors) == 1 for rotors in found):
            continue
        order = tuple(rotors[0] for rotors in found)
        alike = [direction[rotor] == motor.direction for rotor, motor in zip(order, frame.motors, strict=True)]
        if all(alike) or (frame.reversed_type is not None and not any(alike)):
            return Numbering(shape, not alike[0], order)
    return None


def _rotors_at(motor: Place, bearings_deg: Sequence[float], heights_m: Sequence[float]) -> list[int]:
    near = [i for i, bearing in enumerate(bearings_deg) if _apart_deg(bearing, motor.bearing_deg) < _NEAR_DEG]
    if motor.level == 0 or len(near) != 2:
        return near
    low, high = sorted(near, key=heights_m.__getitem__)
    return [] if heights_m[low] == heights_m[high] else [high if motor.level > 0 else low]


def _apart_deg(a: float, b: float) -> float:
    apart = abs(a - b) % _FULL_TURN_DEG
    return min(apart, _FULL_TURN_DEG - apart)
