"""Thrust and moments to rotor speeds within their limits: the inverse of THESIS [2.2].

More than four rotors use the null space of the allocation to stay within limits. Where that does not suffice, they come
as near as possible, in the order of `_PRIORITY`: bounded least squares, O. Härkegård, CDC 2002.
"""

from typing import NamedTuple

import numpy as np

from colibri.autopilot.errors import AutopilotError
from colibri.common.elementary import square
from colibri.common.errors import checked
from colibri.common.jit import Packed, compiled, packed
from colibri.common.matrices import dot, inverse, matmul, matvec
from colibri.common.types import Array, PerRotor
from colibri.plant.vehicle.description import AXES, Vehicle, controlled_axes

_EVEN, _PRIORITY = (1.0, 1.0, 1.0, 1.0), (1.0, 10.0, 10.0, 0.2)  # weights of thrust, roll, pitch, yaw; even first
_SWEEPS, _REGULAR, _REACHED = 400, 1e-7, 2e-3
_YAW_PART = 0.02


class Mixing(NamedTuple):
    allocation: Array  # squared speeds to U1 (N), U2, U3, U4 (N m), (4, m)
    inverse: Array  # (m, 4)


def mixing_of(allocation: Array) -> Packed:
    return packed(Mixing(allocation, exact_inverse(allocation)))


@compiled
def allocate(wrench: Array, mixing: Packed, least: float, most: float) -> Array:
    """Return the squared speeds, (m,), from `least` to `most`, whose wrench, (4,), is the nearest."""
    allocation, inverse = mixing[0].allocation, mixing[0].inverse
    rotors = inverse.shape[0]
    free, squared = np.zeros(rotors), np.empty(rotors)
    within = True
    for i in range(rotors):
        for row in range(4):
            free[i] += inverse[i, row] * wrench[row]
        squared[i] = min(max(free[i], least), most)
        within &= squared[i] == free[i]
    if within:
        return free
    for priority in (_EVEN, _PRIORITY):
        if _approach(wrench, allocation, free, priority, least, most, squared) < _REACHED:
            break
    return squared


@compiled
def _approach(
    wrench: Array, allocation: Array, free: Array, priority: PerRotor, least: float, most: float, squared: Array
) -> float:
    """Move squared speeds, one after another, towards a wrench; return the largest miss, weighted."""
    rotors = squared.shape[0]
    scaled, missed, largest = np.empty((4, rotors)), np.empty(4), 0.0
    for row in range(4):
        whole = 0.0
        for i in range(rotors):
            whole += abs(allocation[row, i])
        scale = priority[row] / whole if whole > 0.0 else 0.0
        missed[row] = -scale * wrench[row]
        for i in range(rotors):
            scaled[row, i] = scale * allocation[row, i]
            missed[row] += scaled[row, i] * squared[i]
    for _ in range(_SWEEPS):
        for i in range(rotors):
            slope, curve = _REGULAR * (squared[i] - free[i]), _REGULAR
            for row in range(4):
                slope += scaled[row, i] * missed[row]
                curve += scaled[row, i] * scaled[row, i]
            to = min(max(squared[i] - slope / curve, least), most)
            for row in range(4):
                missed[row] += scaled[row, i] * (to - squared[i])
            squared[i] = to
    for row in range(4):
        largest = max(largest, abs(missed[row]))
    return largest


def holds_yaw(vehicle: Vehicle) -> bool:
    """Return whether the rotors can yaw both ways in hover; with rank 4 they may still lack it, as none pulls."""
    rotors, top = vehicle.rotors, square(vehicle.rotors.max_speed)
    allocation = vehicle.allocation() * top
    if rotors.count <= len(AXES) or len(controlled_axes(allocation)) < len(AXES):
        return len(controlled_axes(allocation)) == len(AXES)
    mixing, weight_n = mixing_of(allocation), vehicle.body.mass_kg * vehicle.gravity_m_s2
    least, yaw_n_m = square(rotors.idle_speed) / top, _YAW_PART * float(np.abs(allocation[3]).sum())
    for side in (-yaw_n_m, yaw_n_m):
        squared = allocate(np.array([weight_n, 0.0, 0.0, side]), mixing, least, 1.0)
        if abs(dot(allocation[3], squared) - side) > 0.5 * yaw_n_m:
            return False
    return True


class Mixer:
    """The inverse allocation of one vehicle."""

    def __init__(self, vehicle: Vehicle) -> None:
        checked("vehicle", vehicle, Vehicle, "a Vehicle", AutopilotError)
        self._allocation = vehicle.allocation()
        self._mixing = mixing_of(self._allocation)
        self._inverse = self._mixing["inverse"][0]
        self._momentum = vehicle.momentum_along_z()
        self.rotors = vehicle.rotors.count
        self._squared_max = square(vehicle.rotors.max_speed)

    def rotor_speeds(self, wrench: Array) -> Array:
        """Return rotor speeds (N,), in the vehicle's unit, for U1 (N), U2, U3, U4 (N m), within the limits."""
        if self.rotors > len(AXES):
            return np.sqrt(allocate(wrench, self._mixing, 0.0, self._squared_max))
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
