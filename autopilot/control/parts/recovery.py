"""The recovery: an attitude law for any attitude, and a mixer with priorities.

The law turns the thrust axis the shortest way (reduced attitude: Chaturvedi, Sanyal and McClamroch, IEEE Control
Systems 31(3), 2011) and damps the yaw rate.
"""

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.vehicle_model.mixer import allocate
from colibri.common.config import Count, Positive, Table
from colibri.common.jit import Packed, compiled
from colibri.common.kernels import atan2
from colibri.common.types import Array

_ANTIPARALLEL = 1e-6


class RecoverySettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Fallbacks without a plan: the previous plan for some samples, then the recovery."""

    shifted_samples: Count
    turn_1_s: Positive
    rate_1_s: Positive
    max_rate_rad_s: Positive


class TurnGains(NamedTuple):
    angle: float  # rad/s for each rad
    rate: float  # 1/s
    max_rate_rad_s: float


@compiled
def turning_moment(direction: Array, rate: Array, inertia: Array, gains: TurnGains) -> Array:
    """Return the moment, N m, FLU, (3,), that turns body z to a unit direction, FLU, (3,)."""
    across = sqrt(direction[0] * direction[0] + direction[1] * direction[1])
    wanted = np.zeros(3)
    speed = min(gains.angle * atan2(across, direction[2]), gains.max_rate_rad_s)
    if across > _ANTIPARALLEL:
        wanted[0], wanted[1] = -direction[1] / across * speed, direction[0] / across * speed
    else:
        wanted[0] = speed
    ix, iy, iz = inertia
    p, q, r = rate
    moment = np.empty(3)
    moment[0] = ix * gains.rate * (wanted[0] - p) - (iy - iz) * q * r
    moment[1] = iy * gains.rate * (wanted[1] - q) - (iz - ix) * p * r
    moment[2] = -iz * gains.rate * r
    return moment


@compiled
def mix_with_priority(
    thrust_n: float,
    moment_n_m: Array,  # U2, U3, U4
    mixing: Packed,  # of squared speeds, parts of the largest
    min_squared: float,
    max_squared: float,
) -> Array:
    """Return squared rotor speeds, (m,), within their limits: tilting moments first, then thrust, then yaw."""
    inverse = mixing[0].inverse
    if inverse.shape[0] != 4:
        wrench = np.array((thrust_n, moment_n_m[0], moment_n_m[1], moment_n_m[2]))
        return allocate(wrench, mixing, min_squared, max_squared)
    rotors, room = inverse.shape[0], max_squared - min_squared
    squared, yaw = np.empty(rotors), np.empty(rotors)
    for i in range(rotors):
        squared[i] = inverse[i, 1] * moment_n_m[0] + inverse[i, 2] * moment_n_m[1]
        yaw[i] = inverse[i, 3] * moment_n_m[2]
    least, most = _range(squared)
    part = room / (most - least) if most - least > room else 1.0
    for i in range(rotors):
        squared[i] = inverse[i, 0] * thrust_n + squared[i] * part
    least, most = _range(squared)
    shift, share = max(min_squared - least, 0.0) + min(max_squared - most, 0.0), 1.0
    for i in range(rotors):
        squared[i] += shift
        if yaw[i] > 0.0:
            share = min(share, max(max_squared - squared[i], 0.0) / yaw[i])
        elif yaw[i] < 0.0:
            share = min(share, max(squared[i] - min_squared, 0.0) / -yaw[i])
    for i in range(rotors):
        squared[i] = min(max(squared[i] + share * yaw[i], min_squared), max_squared)
    return squared


@compiled
def _range(values: Array) -> tuple[float, float]:
    least, most = inf, -inf
    for value in values:
        least, most = min(least, value), max(most, value)
    return least, most
