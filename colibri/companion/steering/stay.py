"""The track `hover` of a companion: what its options leave out is as the vehicle has it."""

from math import degrees
from typing import NamedTuple

from colibri.autopilot.guidance.trajectories.tracks import Hover, Track
from colibri.common.types import Vector


class Stay(NamedTuple):
    """A place, m, ENU, and a heading; `None` for the vehicle's own."""

    x: float | None = None
    y: float | None = None
    height: float | None = None
    yaw: float | None = None  # degrees

    def place(self, here: Vector) -> Vector:
        x, y, z = (own if given is None else given for given, own in zip(self[:3], here, strict=True))
        return (x, y, z)

    def track(self, here: Vector, yaw_rad: float) -> Track:
        x, y, z = self.place(here)
        return Hover(x=x, y=y, height=z, yaw=degrees(yaw_rad) if self.yaw is None else self.yaw).track()


def stay_of(name: str) -> Stay | None:
    """Return the place of a valid `hover` track; `None` for other tracks."""
    base, _, options = name.partition(":")
    if base != "hover":
        return None
    pairs = (option.partition("=") for option in options.split(",") if option)
    return Stay(**{key: float(value) for key, _, value in pairs})
