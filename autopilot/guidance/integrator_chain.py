"""The chain of integrators that leads the reference to its target, as compiled kernels.

With e = reference - target, each step of the cascade asks the next for

    velocity      v_t - approach(e)         as fast as it can still stop: sqrt(2 a d) far away, k d close by
    acceleration  a_t + d/dt of that + k_v (wanted velocity - v)
    jerk          j_t + k_a (wanted acceleration - a)
    snap          s_t + k_j (wanted jerk - j)

and bounds what it adds to the target's own motion. The acceleration is bounded by what the jerk can end within 1 / k_v,
too: more could not be taken back in time, and would overshoot. A target that is reached is followed exactly, whatever
it does.
"""

from math import ceil, floor, pi, radians, sqrt
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from colibri.common.jit import compiled
from colibri.common.types import Array

Integers: TypeAlias = NDArray[np.int64]

K_POSITION, K_VELOCITY, K_ACCELERATION, K_JERK = 1.5, 4.0, 12.0, 36.0
"""Each loop about three times as fast as the one around it, 1/s."""
K_YAW, K_YAW_RATE = 2.0, 8.0
_MAX_STEP_S = 0.02
"""The quickest loop, of the jerk, must not answer to itself: 36 / s times this is below 1."""
_STOPPING = 0.6
"""Part of the acceleration that stopping may count on; the rest is for keeping to it."""


class Limits(NamedTuple):
    """How fast the reference approaches a target.

    Attributes:
        speed_m_s: Horizontally.
        climb_m_s: Upwards.
        sink_m_s: Downwards.
        acceleration_m_s2: Horizontally.
        lift_m_s2: Vertically.
        jerk_m_s3: In every direction.
        yaw_rate_rad_s: Turning.
        yaw_acceleration_rad_s2: Beginning and ending a turn.
    """

    speed_m_s: float = 5.0
    climb_m_s: float = 3.0
    sink_m_s: float = 1.5
    acceleration_m_s2: float = 3.0
    lift_m_s2: float = 3.0
    jerk_m_s3: float = 12.0
    yaw_rate_rad_s: float = radians(60.0)
    yaw_acceleration_rad_s2: float = radians(180.0)


@compiled
def advance(
    motion: Array,
    heading: Array,
    target: Array,
    kinds: Integers,
    yaw_target: Array,
    turns: bool,
    limits: Limits,
    dt: float,
    out: Array,
    out_heading: Array,
) -> None:
    """Fill `out` (n, 5, 3) and `out_heading` (n, 3) from now on; the snap and yaw acceleration act until the next.

    Between instants that are too far apart for its loops the chain takes several steps.
    """
    steps = ceil(dt / _MAX_STEP_S)
    step = dt / steps
    p, v, a, j = motion[0].copy(), motion[1].copy(), motion[2].copy(), motion[3].copy()
    snap = np.empty(3)
    yaw, rate = heading[0], heading[1]
    for k in range(target.shape[0]):
        for part in range(steps):
            _drive(p, v, a, j, target[k], kinds, limits, snap)
            acceleration = _turn(yaw, rate, yaw_target[k], turns, limits)
            if part == 0:
                out[k, 0], out[k, 1], out[k, 2], out[k, 3], out[k, 4] = p, v, a, j, snap
                out_heading[k, 0], out_heading[k, 1], out_heading[k, 2] = yaw, rate, acceleration
            for i in range(3):
                p[i] += step * (v[i] + step * (a[i] / 2.0 + step * (j[i] / 6.0 + step * snap[i] / 24.0)))
                v[i] += step * (a[i] + step * (j[i] / 2.0 + step * snap[i] / 6.0))
                a[i] += step * (j[i] + step * snap[i] / 2.0)
                j[i] += step * snap[i]
            yaw += step * (rate + step * acceleration / 2.0)
            rate += step * acceleration


@compiled
def _drive(p: Array, v: Array, a: Array, j: Array, target: Array, kinds: Integers, limits: Limits, snap: Array) -> None:
    """Write the snap, (3,): the horizontal axes share their limits, the vertical one has its own."""
    vertically = limits.sink_m_s if p[2] > target[0, 2] else limits.climb_m_s
    jerk = limits.jerk_m_s3
    _drive_axes(p, v, a, j, target, kinds, 0, 2, limits.speed_m_s, limits.acceleration_m_s2, jerk, snap)
    _drive_axes(p, v, a, j, target, kinds, 2, 3, vertically, limits.lift_m_s2, jerk, snap)


@compiled
def _drive_axes(
    p: Array,
    v: Array,
    a: Array,
    j: Array,
    target: Array,
    kinds: Integers,
    first: int,
    last: int,
    max_speed: float,
    max_acceleration: float,
    jerkiest: float,
    snap: Array,
) -> None:
    """Write the snap of the axes from `first` to before `last`."""
    wanted = np.zeros(3)
    distance_squared = 0.0
    for i in range(first, last):
        if kinds[i] == 0:
            distance_squared += (p[i] - target[0, i]) ** 2
    distance = sqrt(distance_squared)
    max_acceleration = min(max_acceleration, jerkiest / K_VELOCITY)
    stopping = _STOPPING * max_acceleration
    speed, slope = _approach(distance, stopping, max_speed, K_POSITION)
    for i in range(first, last):
        if kinds[i] == 0:
            along = (target[0, i] - p[i]) / distance if distance > 0.0 else 0.0
            lead = slope * (target[1, i] - v[i])
            wanted[i] = lead + K_VELOCITY * (target[1, i] + speed * along - v[i])
        elif kinds[i] == 1:
            wanted[i] = K_VELOCITY * (target[1, i] - v[i])
    _bound(wanted, first, last, max_acceleration)
    for i in range(first, last):
        wanted[i] = K_ACCELERATION * (target[2, i] + wanted[i] - a[i])
    _bound(wanted, first, last, jerkiest)
    for i in range(first, last):
        snap[i] = target[4, i] + K_JERK * (target[3, i] + wanted[i] - j[i])


@compiled
def _approach(distance: float, stopping: float, max_speed: float, gain: float) -> tuple[float, float]:
    """Return the speed towards a place at `distance`, and how it changes with it."""
    near = stopping / gain**2
    if distance <= near:
        speed, slope = gain * distance, gain
    else:
        speed = sqrt(stopping * (2.0 * distance - near))
        slope = stopping / speed
    if speed > max_speed:
        return max_speed, 0.0
    return speed, slope


@compiled
def _bound(vector: Array, first: int, last: int, maximum: float) -> None:
    """Shorten the part of a vector from `first` to before `last` to `maximum`, in place."""
    squared = 0.0
    for i in range(first, last):
        squared += vector[i] ** 2
    if squared > maximum**2:
        for i in range(first, last):
            vector[i] *= maximum / sqrt(squared)


@compiled
def _turn(yaw: float, rate: float, target: Array, turns: bool, limits: Limits) -> float:
    """Return the yaw acceleration, rad/s²."""
    wanted = target[1]
    slope = 0.0
    if turns:
        left = target[0] - yaw
        left -= 2.0 * pi * floor(left / (2.0 * pi) + 0.5)
        stopping = _STOPPING * limits.yaw_acceleration_rad_s2
        speed, slope = _approach(abs(left), stopping, limits.yaw_rate_rad_s, K_YAW)
        wanted += speed if left > 0.0 else -speed
    maximum = limits.yaw_acceleration_rad_s2
    added = slope * (target[1] - rate) + K_YAW_RATE * (wanted - rate)
    acceleration: float = target[2] + min(max(added, -maximum), maximum)
    return acceleration
