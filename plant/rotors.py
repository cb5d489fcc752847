"""Rotor speeds -> what they do to the body, THESIS [2.2], [2.3]."""

import numpy as np

from plant.dynamics import Wrench
from plant.vehicle import Vehicle

RotorSpeeds = tuple[float, float, float, float]


class Rotors:
    """The rotors of one vehicle, which follow their command at once."""

    def __init__(self, vehicle: Vehicle) -> None:
        """Take the coefficients from `vehicle`."""
        self._allocation = vehicle.allocation()
        self._momentum = vehicle.rotor_momentum()
        self._max_speed = vehicle.rotors.max_speed

    def speeds(self, controls: tuple[float, float, float, float]) -> RotorSpeeds:
        """Return the rotor speeds, in the vehicle's unit, of controls 0..1."""
        c1, c2, c3, c4 = controls
        top = self._max_speed
        return (c1 * top, c2 * top, c3 * top, c4 * top)

    def wrench(self, speeds: RotorSpeeds) -> Wrench:
        """Return thrust, moments and momentum of rotors at `speeds` (the vehicle's unit)."""
        omega = np.array(speeds)
        u1, u2, u3, u4 = (self._allocation @ (omega * omega)).tolist()
        return Wrench(u1, (u2, u3, u4), float(self._momentum @ omega))
