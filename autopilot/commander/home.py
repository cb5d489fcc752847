"""Home and the geodetic origin."""

from colibri.common.earth.geodesy import Geodetic
from colibri.common.types import Vector
from colibri.mavlink.wire.dialect import Refusal
from colibri.mavlink.wire.places import far

_ORIGIN: Vector = (0.0, 0.0, 0.0)
_OFF_M = 10.0
_UNCERTAIN_M = 0.5  # allowed difference between estimated heights and heights above sea level


class Home:
    """Home of one vehicle: the take-off place, unless `chosen` by a command."""

    def __init__(self, origin: Geodetic) -> None:
        self.origin = origin
        self.position_enu_m = _ORIGIN
        self.yaw_rad = self.armed_yaw_rad = 0.0
        self.chosen = False

    def move(self, position_enu_m: Vector, yaw_rad: float, *, chosen: bool = True) -> None:
        self.position_enu_m, self.yaw_rad, self.chosen = position_enu_m, yaw_rad, chosen

    def propose(self, position_enu_m: Vector, yaw_rad: float) -> None:
        self.armed_yaw_rad = yaw_rad
        if not self.chosen:
            self.position_enu_m, self.yaw_rad = position_enu_m, yaw_rad

    def doubt(self, here: Vector) -> str:
        """Return why home may be a mistake for a vehicle `here`, or an empty text."""
        away, up_m = far(self.position_enu_m, here), self.position_enu_m[2]
        side = "above" if up_m > 0.0 else "below"
        return f"home: {away}" if away else f"home: {abs(up_m):.0f} m {side} the ground" if abs(up_m) > _OFF_M else ""

    def refusal(self, height_m: float) -> Refusal | None:
        """Refuse a height, z of ENU, m, that is below both the origin and home."""
        below_m = min(0.0, self.position_enu_m[2]) - height_m
        return Refusal(f"{below_m:.1f} m below the ground") if below_m > _UNCERTAIN_M else None

    def remark(self, height_m: float) -> str:
        """Return a warning of a height along the ground, or an empty text."""
        above_m = height_m - min(0.0, self.position_enu_m[2])
        return f"{above_m:.1f} m above home is along the ground" if above_m < _UNCERTAIN_M else ""
