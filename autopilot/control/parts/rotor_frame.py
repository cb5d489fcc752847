"""Rotor order, X and + layouts: a vehicle as a law from elsewhere sees it."""

from collections.abc import Sequence
from math import degrees, radians
from typing import Literal, TypeAlias

import numpy as np

from colibri.autopilot.control.interface import VehicleState
from colibri.autopilot.errors import AutopilotError
from colibri.common.elementary import atan2, cos, sin
from colibri.common.errors import checked, unknown
from colibri.common.rotations import euler_from_quaternion, nearest_turn
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle

Layout: TypeAlias = Literal["px4-x", "px4-+", "betaflight-x", "crazyflie-x"]
# Bearings of the rotors from the front, degrees, clockwise from above; + turns counter-clockwise.
LAYOUTS: dict[Layout, tuple[tuple[float, ...], str]] = {
    "px4-x": ((45.0, -135.0, -45.0, 135.0), "++--"),
    "px4-+": ((90.0, -90.0, 0.0, 180.0), "++--"),
    "betaflight-x": ((135.0, 45.0, -135.0, -45.0), "-++-"),
    "crazyflie-x": ((45.0, 135.0, -135.0, -45.0), "+-+-"),
}
_NEAR_DEG = 20.0
_TURNS_DEG = (0.0, 45.0, -45.0, 90.0, -90.0, 135.0, -135.0, 180.0)


class RotorFrame:
    """A vehicle in the rotor order and the axes of a law from elsewhere, such as a learned policy.

    Attributes:
        order: For each of the law's rotors, its index in the vehicle file.
        yaw_deg: Of the law's forward axis in the vehicle's body, counter-clockwise: 45 for an X law on a +.
    """

    def __init__(self, vehicle: Vehicle, layout: Layout = "px4-x") -> None:
        checked("vehicle", vehicle, Vehicle, "a Vehicle", AutopilotError)
        if layout not in LAYOUTS:
            raise AutopilotError(unknown("layout", layout, LAYOUTS))
        bearings_deg, turning = LAYOUTS[layout]
        there_deg = [degrees(atan2(y, x)) for x, y, *_ in vehicle.rotors.position_m]
        for turn_deg in _TURNS_DEG:
            wanted_deg = [turn_deg - bearing for bearing in bearings_deg]
            near = [[i for i, at in enumerate(there_deg) if _apart_deg(at, want) < _NEAR_DEG] for want in wanted_deg]
            order = [places[0] for places in near if len(places) == 1]
            signs = "".join("+" if vehicle.rotors.direction[i] == "ccw" else "-" for i in order)
            if len(order) == len(there_deg) and signs == turning:
                break
        else:
            raise AutopilotError(f'layout "{layout}": the rotors of {vehicle.name} are placed or turn differently')
        self.order, self.yaw_deg = np.array(order), turn_deg
        half_rad = 0.5 * radians(self.yaw_deg)
        self._cos, self._sin = cos(half_rad), sin(half_rad)

    def state(self, state: VehicleState) -> VehicleState:
        """Return the state in the law's axes and rotor order."""
        (w, x, y, z), (p, q, r), c, s = state.attitude, state.rate_flu_rad_s, self._cos, self._sin
        attitude = (w * c - z * s, x * c + y * s, y * c - x * s, z * c + w * s)
        cosine, sine = c * c - s * s, 2.0 * s * c
        phi, theta, psi = euler_from_quaternion(attitude)
        return state._replace(
            attitude=attitude,
            euler=(phi, theta, nearest_turn(psi, state.euler[2] + radians(self.yaw_deg))),
            rate_flu_rad_s=(cosine * p + sine * q, cosine * q - sine * p, r),
            rotor_speeds=tuple(state.rotor_speeds[i] for i in self.order),
        )

    def to_vehicle(self, of_rotors: Sequence[float] | Array) -> Array:
        """Return values of the law's rotors (4,), such as speeds, in the vehicle's order."""
        placed = np.empty(len(self.order))
        placed[self.order] = of_rotors
        return placed


def _apart_deg(a: float, b: float) -> float:
    return abs((a - b + 180.0) % 360.0 - 180.0)
