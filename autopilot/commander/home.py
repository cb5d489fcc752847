"""Home: where to return to, and where the origin of the ENU frame lies on earth."""

from colibri.common.earth.geodesy import Geodetic
from colibri.common.types import Vector
from colibri.mavlink.wire.refusal import Refusal

_ORIGIN: Vector = (0.0, 0.0, 0.0)
_UNCERTAIN_M = 0.5
"""By which heights above sea level, and those that are estimated, may differ."""


class Home:
    """Home of one vehicle. The pilot moves it; the fence, the missions and the commands measure from it.

    Attributes:
        position_enu_m: Where the vehicle took off, or the place that was chosen, m.
        yaw_rad: Heading there, rad.
        chosen: Whether somebody chose it: a take-off then leaves it where it is.
    """

    def __init__(self, origin: Geodetic) -> None:
        self.origin = origin
        self.position_enu_m = _ORIGIN
        self.yaw_rad = 0.0
        self.chosen = False

    def move(self, position_enu_m: Vector, yaw_rad: float) -> None:
        """Set home to where somebody chose it."""
        self.position_enu_m, self.yaw_rad, self.chosen = position_enu_m, yaw_rad, True

    def propose(self, position_enu_m: Vector, yaw_rad: float) -> None:
        """Set home to where the vehicle stands, unless somebody chose another place."""
        if not self.chosen:
            self.position_enu_m, self.yaw_rad = position_enu_m, yaw_rad

    def refusal(self, height_m: float) -> Refusal | None:
        """Return why no vehicle may fly to a height, m, ENU: it is below the origin, and home; None if it may."""
        below_m = min(0.0, self.position_enu_m[2]) - height_m
        return Refusal(f"{below_m:.1f} m below the ground") if below_m > _UNCERTAIN_M else None

    def move_origin(self, place: Geodetic) -> None:
        """Set the origin of the ENU frame; positions in it stay the same numbers."""
        self.origin = place

    def resume(self, position_enu_m: Vector, yaw_rad: float, *, chosen: bool) -> None:
        """Set home as it was before a restart."""
        self.position_enu_m, self.yaw_rad, self.chosen = position_enu_m, yaw_rad, chosen
