"""Kernels that slew an attitude demand by v' = w² (target - x) + 2 w (target' - v), bounded.

For a rate only v' = 2 w (target' - v). A maximum acceleration of at least w times the maximum rate avoids overshoot.
"""

from math import floor, isnan, pi, sqrt
from typing import NamedTuple

import numpy as np

from colibri.common.jit import compiled
from colibri.common.kernels import atan2, cos, sin
from colibri.common.matrices import put
from colibri.common.types import Array, Vector

TILT, ATTITUDE, RATE = 0, 1, 2
_NO_DIRECTION = 1e-9


class Slew(NamedTuple):
    """Limits of tilt, rates and accelerations; w as frequencies. Attitudes are not limited if `free`."""

    max_tilt_rad: float
    tilt_frequency_rad_s: float
    tilt_rate_rad_s: float
    tilt_acceleration_rad_s2: float
    yaw_frequency_rad_s: float
    yaw_rate_rad_s: float
    yaw_acceleration_rad_s2: float
    thrust_rate_n_s: float
    free: bool = False


class AttitudeCommand(NamedTuple):
    """Target of a demand."""

    kind: int
    vector: Vector  # TILT: phi, theta, rad, 0. ATTITUDE: thrust direction, ENU. RATE: p, q, r, rad/s
    yaw_rad: float
    yaw_rate_rad_s: float  # TILT: turn rate. ATTITUDE: feed-forward
    thrust_n: float  # nan: the thrust that carries the weight at any tilt


@compiled
def slew_on(
    command: AttitudeCommand,
    weight_n: float,
    slew: Slew,
    interval_s: float,
    angles: Array,
    rates: Array,
    thrusts: Array,
) -> None:
    """Fill angles phi, theta, psi and rates, (n, 3), and thrusts, N, (n,), starting from their first rows."""
    kind, vector, yaw_rad = command.kind, command.vector, command.yaw_rad
    wanted, wanted_rate = np.zeros(3), np.zeros(3)
    free, over = slew.free and kind == ATTITUDE, False
    if free:
        over, yaw_rad = _nearest_way(vector, yaw_rad, angles[0], wanted)
    for n in range(angles.shape[0] - 1):
        here, there = angles[n], angles[n + 1]
        put(here, there)
        put(rates[n], rates[n + 1])
        if kind == RATE:
            _euler_rates(here, vector, wanted_rate)
        else:
            wanted_rate[2] = command.yaw_rate_rad_s
        towards = here[2] if kind != ATTITUDE else _near(yaw_rad, here[2])
        w, max_rate, max_acceleration = slew.yaw_frequency_rad_s, slew.yaw_rate_rad_s, slew.yaw_acceleration_rad_s2
        pull = w * w * (towards - here[2])
        _move(2, pull, wanted_rate[2], w, max_rate, max_acceleration, interval_s, there, rates[n + 1])
        if kind == TILT:
            wanted[0], wanted[1] = vector[0], vector[1]
        elif kind == ATTITUDE:
            _aim(vector, there[2], free, over, slew.max_tilt_rad, here, wanted)
            phi, theta = wanted[0], wanted[1]
            _aim(vector, here[2], free, over, slew.max_tilt_rad, here, wanted)
            wanted_rate[0], wanted_rate[1] = (phi - wanted[0]) / interval_s, (theta - wanted[1]) / interval_s
        w, max_rate, max_acceleration = slew.tilt_frequency_rad_s, slew.tilt_rate_rad_s, slew.tilt_acceleration_rad_s2
        for i in range(2):
            pull = 0.0 if kind == RATE else w * w * (wanted[i] - here[i])
            _move(i, pull, wanted_rate[i], w, max_rate, max_acceleration, interval_s, there, rates[n + 1])
        if not free:
            limit_tilt(there, rates[n + 1], slew.max_tilt_rad)
        up = cos(there[0]) * cos(there[1])
        if free:
            up = max(up, cos(slew.max_tilt_rad))
        thrust = weight_n / up if isnan(command.thrust_n) else command.thrust_n
        maximum = slew.thrust_rate_n_s * interval_s
        thrusts[n + 1] = thrusts[n] + min(max(thrust - thrusts[n], -maximum), maximum)


@compiled
def _move(
    i: int,
    pull: float,
    wanted_rate: float,
    w: float,
    max_rate: float,
    max_acceleration: float,
    interval_s: float,
    angles: Array,
    rates: Array,
) -> None:
    acceleration = min(max(pull + 2.0 * w * (wanted_rate - rates[i]), -max_acceleration), max_acceleration)
    rate = min(max(rates[i] + interval_s * acceleration, -max_rate), max_rate)
    angles[i] += 0.5 * interval_s * (rates[i] + rate)
    rates[i] = rate


@compiled
def _euler_rates(angles: Array, rate: Vector, out: Array) -> None:
    """Write T(phi, theta) [p q r], THESIS [2.7]."""
    s, c = sin(angles[0]), cos(angles[0])
    swing = s * rate[1] + c * rate[2]
    out[0] = rate[0] + sin(angles[1]) / cos(angles[1]) * swing
    out[1] = c * rate[1] - s * rate[2]
    out[2] = swing / cos(angles[1])


@compiled
def _aim(
    direction: Vector, psi: float, free: bool, over: bool, max_tilt_rad: float, here: Array, angles: Array
) -> None:
    """Write roll and pitch that point body z along `direction`, ENU: within the tilt limit, or `free` and near `here`.

    If free, roll is beyond 90 degrees with `over`.
    """
    x, y, z = direction[0], direction[1], direction[2]
    horizontal = sqrt(x * x + y * y)
    if not free and horizontal < _NO_DIRECTION:
        x, y, z = 0.0, 0.0, 1.0
    elif not free and z < cos(max_tilt_rad) * sqrt(horizontal * horizontal + z * z):
        x, y, z = x / horizontal * sin(max_tilt_rad), y / horizontal * sin(max_tilt_rad), cos(max_tilt_rad)
    c, s = cos(psi), sin(psi)
    ahead = x * c + y * s
    phi, theta = atan2(x * s - y * c, sqrt(ahead * ahead + z * z)), atan2(ahead, z)
    angles[0], angles[1] = phi, theta
    if free:
        angles[0] = _near(pi - phi if over else phi, here[0])
        angles[1] = _near(pi + theta if over else theta, here[1])


@compiled
def _near(angle: float, other: float) -> float:
    return angle - 2.0 * pi * floor((angle - other) / (2.0 * pi) + 0.5)


@compiled
def _nearest_way(direction: Vector, yaw_rad: float, here: Array, angles: Array) -> tuple[bool, float]:
    """Choose how to reach an attitude, by roll or by pitch: whether roll is beyond 90 degrees, and yaw."""
    over, best, found = False, 1e9, yaw_rad
    for half in range(2):
        beyond, yaw = (direction[2] < 0.0) != (half == 1), yaw_rad + half * pi
        _aim(direction, yaw, True, beyond, pi, here, angles)
        way = abs(angles[0] - here[0]) + abs(angles[1] - here[1]) + abs(_near(yaw, here[2]) - here[2])
        if way < best:
            over, best, found = beyond, way, yaw
    return over, found


@compiled
def limit_tilt(angles: Array, rates: Array, max_tilt_rad: float) -> None:
    """Limit the tilt of phi, theta, and remove the rates that lead beyond it, in place."""
    s, c, st, ct = sin(angles[0]), cos(angles[0]), sin(angles[1]), cos(angles[1])
    if c * ct >= cos(max_tilt_rad):
        return
    across = sqrt(s * s + c * c * st * st)
    if across < _NO_DIRECTION:
        angles[0], angles[1] = 0.0, 0.0
    else:
        scale = sin(max_tilt_rad) / across
        left, ahead = -s * scale, c * st * scale
        angles[0] = atan2(-left, sqrt(ahead * ahead + cos(max_tilt_rad) ** 2))
        angles[1] = atan2(ahead, cos(max_tilt_rad))
    s, c, st, ct = sin(angles[0]), cos(angles[0]), sin(angles[1]), cos(angles[1])
    outwards, steeper = s * ct, c * st
    squared = outwards * outwards + steeper * steeper
    leaving = outwards * rates[0] + steeper * rates[1]
    if leaving > 0.0 and squared > 0.0:
        rates[0] -= leaving / squared * outwards
        rates[1] -= leaving / squared * steeper
