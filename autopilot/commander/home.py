"""Home: where to return to, and where the origin of the ENU frame lies on earth."""

from colibri.common.earth.geodesy import Geodetic
from colibri.common.types import Vector

_ORIGIN: Vector = (0.0, 0.0, 0.0)


class Home:
    """Home of one vehicle. The pilot moves it; the fence, the missions and the commands measure from it.

    Attributes:
        origin: Of the ENU frame.
        position_enu_m: Where the vehicle took off, or the place that was chosen, m.
        yaw_rad: Heading there, rad.
        chosen: Whether somebody chose it: a take-off then leaves it where it is.
    """

    def __init__(self, origin: Geodetic) -> None:
        """Begin at the origin, chosen by nobody."""
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

    def move_origin(self, place: Geodetic) -> None:
        """Set the origin of the ENU frame; positions in it stay the same numbers."""
        self.origin = place

    def resume(self, position_enu_m: Vector, yaw_rad: float, *, chosen: bool) -> None:
        """Set home as it was before a restart."""
        self.position_enu_m, self.yaw_rad, self.chosen = position_enu_m, yaw_rad, chosen
