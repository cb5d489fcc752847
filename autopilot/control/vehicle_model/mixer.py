"""Thrust and moments to rotor speeds within their limits: the inverse of THESIS [2.2]."""

import numpy as np

from colibri.autopilot.errors import AutopilotError
from colibri.common.elementary import square
from colibri.common.errors import checked
from colibri.common.matrices import dot, inverse, matmul, matvec
from colibri.common.types import Array
from colibri.plant.vehicle.description import AXES, Vehicle, controlled_axes


class Mixer:
    """The inverse allocation of one vehicle."""

    def __init__(self, vehicle: Vehicle) -> None:
        checked("vehicle", vehicle, Vehicle, "a Vehicle", AutopilotError)
        self._allocation = vehicle.allocation()
        self._inverse = exact_inverse(self._allocation)
        self._momentum = vehicle.rotor_momentum()
        self.rotors = vehicle.rotors.count
        self._squared_max = square(vehicle.rotors.max_speed)

    def rotor_speeds(self, wrench: Array) -> Array:
        """Return rotor speeds (N,), in the vehicle's unit, for U1 (N), U2, U3, U4 (N m), within the limits."""
        return np.sqrt(np.clip(matvec(self._inverse, wrench), 0.0, self._squared_max))

    def wrench(self, speeds: Array) -> Array:
        """Return U1..U4 (4,) of rotor speeds (N,)."""
        return matvec(self._allocation, speeds * speeds)

    def momentum(self, speeds: Array) -> float:
        """Return the rotors' angular momentum h along body z, N m s."""
        return dot(self._momentum, speeds)


def exact_inverse(allocation: Array) -> Array:
    """Return the pseudo-inverse of an allocation, (4, N): (N, 4). It keeps an airframe's symmetry to the last bit.

    Orthogonal rows need only division; elimination leaves moments of 1e-17 N m, enough to drift. Moments about the
    yaw axis are left out if the rotors cannot set them beside thrust, roll and pitch.
    """
    axes = len(controlled_axes(allocation))
    if axes < len(AXES):
        left_out = np.zeros((allocation.shape[1], len(AXES) - axes))
        return np.concatenate([_right_inverse(allocation[:axes]), left_out], axis=1)
    return _right_inverse(allocation)


def _right_inverse(allocation: Array) -> Array:
    scale = np.sqrt((allocation * allocation).sum(axis=1))
    unit = allocation / scale[:, None]
    exact: Array = matmul(unit.T, inverse(matmul(unit, unit.T))) / scale
    return exact
