"""Home and the geodetic origin."""

from colibri.common.earth.geodesy import Geodetic
from colibri.common.types import Vector
from colibri.mavlink.wire.refusal import Refusal

_ORIGIN: Vector = (0.0, 0.0, 0.0)
_UNCERTAIN_M = 0.5
"""Allowed difference between estimated heights and heights above sea level."""


class Home:
    """Home of one vehicle: the take-off place, unless `chosen` by a command."""

    def __init__(self, origin: Geodetic) -> None:
        self.origin = origin
        self.position_enu_m = _ORIGIN
        self.yaw_rad = 0.0
        self.chosen = False

    def move(self, position_enu_m: Vector, yaw_rad: float, *, chosen: bool = True) -> None:
        self.position_enu_m, self.yaw_rad, self.chosen = position_enu_m, yaw_rad, chosen

    def propose(self, position_enu_m: Vector, yaw_rad: float) -> None:
        if not self.chosen:
            self.position_enu_m, self.yaw_rad = position_enu_m, yaw_rad

    def refusal(self, height_m: float) -> Refusal | None:
        """Refuse a height, z of ENU, m, that is below both the origin and home."""
        below_m = min(0.0, self.position_enu_m[2]) - height_m
        return Refusal(f"{below_m:.1f} m below the ground") if below_m > _UNCERTAIN_M else None

    def move_origin(self, place: Geodetic) -> None:
        """Set the origin of the ENU frame; ENU coordinates keep their values."""
        self.origin = place
