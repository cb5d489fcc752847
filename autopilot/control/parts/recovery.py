"""The recovery: an attitude law for any attitude, and a mixer with priorities.

The law turns the thrust axis the shortest way (reduced attitude: Chaturvedi, Sanyal and McClamroch, IEEE Control
Systems 31(3), 2011) and damps the yaw rate.
"""

from math import sqrt
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
    tilt = inverse[:, 1] * moment_n_m[0] + inverse[:, 2] * moment_n_m[1]
    yaw = inverse[:, 3] * moment_n_m[2]
    room = max_squared - min_squared
    spread = tilt.max() - tilt.min()
    if spread > room:
        tilt *= room / spread
    lift = inverse[:, 0] * thrust_n
    minimum, maximum = (lift + tilt).min(), (lift + tilt).max()
    shift = max(min_squared - minimum, 0.0) + min(max_squared - maximum, 0.0)
    squared = lift + tilt + shift
    share = 1.0
    for i in range(squared.shape[0]):
        if yaw[i] > 0.0:
            share = min(share, max(max_squared - squared[i], 0.0) / yaw[i])
        elif yaw[i] < 0.0:
            share = min(share, max(squared[i] - min_squared, 0.0) / -yaw[i])
    result: Array = squared + share * yaw
    for i in range(result.shape[0]):
        result[i] = min(max(result[i], min_squared), max_squared)
    return result
