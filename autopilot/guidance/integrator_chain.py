"""Chain of integrators that leads the reference to its target.

With e = reference - target, each loop commands the next:

    velocity      v_t - approach(e)         the fastest that can still stop: sqrt(2 a d) far away, k d close by
    acceleration  a_t + d/dt of that + k_v (wanted velocity - v)
    jerk          j_t + k_a (wanted acceleration - a)
    snap          s_t + k_j (wanted jerk - j)

and bounds its addition to the target's motion. The jerk must be able to end the acceleration within 1 / k_v. The snap
is bounded because the moments produce it.
"""

from functools import lru_cache
from math import ceil, floor, pi, radians, sqrt
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from colibri.common.jit import Packed, compiled, packed
from colibri.common.types import Array

Integers: TypeAlias = NDArray[np.int64]

K_POSITION, K_VELOCITY, K_ACCELERATION, K_JERK = 1.5, 4.0, 12.0, 36.0  # 1/s: each about three times the outer one
K_YAW, K_YAW_RATE = 2.0, 8.0
_MAX_STEP_S = 0.02  # stability limit of the jerk loop: K_JERK times this is below 1
_JERK_ENDS_S = 0.11  # to end the largest jerk by the largest snap: less than 1 / k_a is useless, more overshoots
_STOPPING = 0.6  # part of the acceleration planned for stopping; the rest is for tracking it
_JERK, _JERK_SCALE = 3, 1e-2  # jerk settles last, and has the largest numbers


class Limits(NamedTuple):
    speed_m_s: float = 5.0
    climb_m_s: float = 3.0
    sink_m_s: float = 1.5
    acceleration_m_s2: float = 3.0
    lift_m_s2: float = 3.0
    jerk_m_s3: float = 12.0
    yaw_rate_rad_s: float = radians(60.0)
    yaw_acceleration_rad_s2: float = radians(180.0)


@lru_cache(maxsize=64)
def packed_limits(limits: Limits) -> Packed:
    """Return a record, which kernels unbox three times as fast."""
    return packed(limits)


@lru_cache(maxsize=64)
def limited(limits: Limits, **others: float) -> Limits:
    return limits._replace(**others)


class Axes(NamedTuple):
    """Axes `first` to before `last`, with their limits."""

    first: int
    last: int
    speed_m_s: float
    acceleration_m_s2: float
    jerk_m_s3: float


@compiled
def advance(
    motion: Array,  # position to jerk now, ENU, (4, 3)
    heading: Array,  # yaw and rate now, (2,)
    target: Array,  # position to snap, ENU, (n, 5, 3)
    kinds: Integers,  # binding derivative of each axis, (3,)
    target_heading: Array,  # yaw, rate, acceleration, (n, 3)
    turns: bool,  # whether yaw binds; otherwise its rate
    limits: Packed,
    dt: float,  # between instants, s
) -> tuple[Array, Array]:
    """Return motion, (5, n, 3), and heading, (3, n), from now on; a long `dt` takes several steps."""
    count = target.shape[0]
    out, out_heading = np.empty((5, count, 3)), np.empty((3, count))
    steps = ceil(dt / _MAX_STEP_S)
    step = dt / steps
    motion = motion.copy()
    p, v, a, j = motion[0], motion[1], motion[2], motion[3]
    snap, wanted = np.empty(3), np.empty(3)
    yaw, rate = heading[0], heading[1]
    for k in range(count):
        for part in range(steps):
            _drive(motion, target[k], kinds, limits[0], wanted, snap)
            acceleration = _turn(yaw, rate, target_heading[k], turns, limits[0])
            if part == 0:
                for i in range(3):
                    out[4, k, i] = snap[i]
                    for order in range(4):
                        out[order, k, i] = motion[order, i]
                out_heading[0, k], out_heading[1, k], out_heading[2, k] = yaw, rate, acceleration
            for i in range(3):
                p[i] += step * (v[i] + step * (a[i] / 2.0 + step * (j[i] / 6.0 + step * snap[i] / 24.0)))
                v[i] += step * (a[i] + step * (j[i] / 2.0 + step * snap[i] / 6.0))
                a[i] += step * (j[i] + step * snap[i] / 2.0)
                j[i] += step * snap[i]
            yaw += step * (rate + step * acceleration / 2.0)
            rate += step * acceleration
    return out, out_heading


@compiled
def is_near(motion: Array, target: Array, within: float) -> bool:
    """Whether position to jerk, ENU, (4, 3), are within a distance of a target's."""
    for order in range(motion.shape[0]):
        scale = _JERK_SCALE if order == _JERK else 1.0
        for i in range(3):
            if not abs(motion[order, i] - target[order, i]) * scale < within:
                return False
    return True


@compiled
def _drive(motion: Array, target: Array, kinds: Integers, limits: Limits, wanted: Array, snap: Array) -> None:
    """Write the snap, (3,): x and y share their limits, z has its own."""
    vertically = limits.sink_m_s if motion[0, 2] > target[0, 2] else limits.climb_m_s
    jerk = limits.jerk_m_s3
    _drive_axes(motion, target, kinds, Axes(0, 2, limits.speed_m_s, limits.acceleration_m_s2, jerk), wanted, snap)
    _drive_axes(motion, target, kinds, Axes(2, 3, vertically, limits.lift_m_s2, jerk), wanted, snap)


@compiled
def _drive_axes(motion: Array, target: Array, kinds: Integers, axes: Axes, wanted: Array, snap: Array) -> None:
    p, v, a, j = motion[0], motion[1], motion[2], motion[3]
    first, last = axes.first, axes.last
    distance_squared = 0.0
    for i in range(first, last):
        wanted[i] = 0.0
        if kinds[i] == 0:
            distance_squared += (p[i] - target[0, i]) ** 2
    distance = sqrt(distance_squared)
    max_acceleration = min(axes.acceleration_m_s2, axes.jerk_m_s3 / K_VELOCITY)
    stopping = _STOPPING * max_acceleration
    speed, slope = _approach(distance, stopping, axes.speed_m_s, K_POSITION)
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
    _bound(wanted, first, last, axes.jerk_m_s3)
    for i in range(first, last):
        wanted[i] = K_JERK * (target[3, i] + wanted[i] - j[i])
    _bound(wanted, first, last, axes.jerk_m_s3 / _JERK_ENDS_S)
    for i in range(first, last):
        snap[i] = target[4, i] + wanted[i]


@compiled
def _approach(distance: float, stopping: float, max_speed: float, gain: float) -> tuple[float, float]:
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
    squared = 0.0
    for i in range(first, last):
        squared += vector[i] ** 2
    if squared > maximum**2:
        for i in range(first, last):
            vector[i] *= maximum / sqrt(squared)


@compiled
def _turn(yaw: float, rate: float, target: Array, turns: bool, limits: Limits) -> float:
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
