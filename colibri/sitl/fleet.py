"""Several vehicles at once, each with a plant, an autopilot and ground stations of its own, in one simulated time."""

from colibri.sitl.stepping import Stepped
from colibri.sitl.vehicle import Sitl


class Fleet(tuple[Sitl, ...], Stepped):
    """Vehicles whose time goes on together: none is ever more than a frame ahead."""

    __slots__ = ()

    @property
    def time_us(self) -> int:
        """Simulated time of the vehicle that is behind, µs."""
        return min(sitl.time_us for sitl in self)

    def step(self) -> None:
        """Fly one frame of whoever is behind."""
        behind_us = self.time_us
        for sitl in self:
            if sitl.time_us == behind_us:
                sitl.step()

    def __str__(self) -> str:
        """Return the state of each vehicle, for the message of a failed test."""
        return "; ".join(f"vehicle {sitl.system}: {sitl}" for sitl in self)
