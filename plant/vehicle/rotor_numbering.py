"""Numbering of a vehicle's rotors by other autopilots.

PX4 and ArduPilot number alike: '+' is right, left, front, rear; 'x' is front right, rear left, front left, rear right.
The first two turn counter-clockwise and the last two clockwise, or in a reversed frame the other way round. Sources:
PX4 Airframes Reference, Quadrotor x and +; ArduPilot, AP_MotorsMatrix.cpp, MOTOR_FRAME_QUAD.
"""

from collections.abc import Sequence
from math import degrees
from typing import Literal, NamedTuple, TypeAlias

from colibri.common.elementary import atan2
from colibri.common.types import PerRotor

Shape: TypeAlias = Literal["+", "x"]

_BEARINGS_DEG: dict[Shape, tuple[float, ...]] = {"+": (90.0, -90.0, 0.0, 180.0), "x": (45.0, -135.0, -45.0, 135.0)}
_NEAR_DEG = 20.0
_FULL_TURN_DEG = 360.0
_USUAL = ("ccw", "ccw", "cw", "cw")
_REVERSED = ("cw", "cw", "ccw", "ccw")
_FRAME_TYPES: dict[tuple[Shape, bool], int] = {("+", False): 0, ("+", True): 6, ("x", False): 1, ("x", True): 3}


class Numbering(NamedTuple):
    """Rotor order of PX4 and ArduPilot: for each of their motors, the index in the vehicle file."""

    shape: Shape
    reverse: bool
    rotors: tuple[int, int, int, int]

    def to_vehicle(self, motors: PerRotor) -> PerRotor:
        a, b, c, d = self.rotors
        given = [0.0, 0.0, 0.0, 0.0]
        given[a], given[b], given[c], given[d] = motors
        return (given[0], given[1], given[2], given[3])

    def to_motors(self, rotors: PerRotor) -> PerRotor:
        a, b, c, d = self.rotors
        return (rotors[a], rotors[b], rotors[c], rotors[d])

    @property
    def ardupilot_frame_type(self) -> int:
        """FRAME_TYPE; ArduPilot calls a reversed 'x' H."""
        return _FRAME_TYPES[self.shape, self.reverse]


def numbering(position_m: Sequence[tuple[float, ...]], direction: Sequence[str]) -> Numbering | None:
    """Return the numbering; `None` if the rotors are neither a '+' nor an 'x', or do not turn as in one."""
    bearings_deg = [degrees(atan2(-y, x)) for x, y, *_ in position_m]
    for shape, wanted_deg in _BEARINGS_DEG.items():
        nearest = [[i for i in range(4) if _apart_deg(bearings_deg[i], want) < _NEAR_DEG] for want in wanted_deg]
        if not all(len(found) == 1 for found in nearest):
            continue
        a, b, c, d = (found[0] for found in nearest)
        turning = tuple(direction[i] for i in (a, b, c, d))
        if turning in (_USUAL, _REVERSED):
            return Numbering(shape, turning == _REVERSED, (a, b, c, d))
    return None


def _apart_deg(a: float, b: float) -> float:
    apart = abs(a - b) % _FULL_TURN_DEG
    return min(apart, _FULL_TURN_DEG - apart)
