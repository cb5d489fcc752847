"""Model of a vehicle under a stack's rate loop, and a law slowed down for it.

With commanded rates c and time constant T, w' = (c - w) / T is a lag of first order. With a lag L of the acceleration,
w' = a, a' = ((c - w) / T - a) / L is one of second.
"""

from math import ceil, sqrt
from typing import Any, NamedTuple

import numpy as np

from colibri.autopilot.control.profile import Profile
from colibri.common.compiled_rotations import rotation_matrix
from colibri.common.jit import Packed, compiled
from colibri.common.kernels import exp
from colibri.common.types import Array, Vector
from colibri.companion.stack import Response
from colibri.plant.vehicle.description import Vehicle

STATES, COMMANDS = 17, 4
POSITION, VELOCITY, ATTITUDE, RATE, LIFT = slice(3), slice(3, 6), slice(6, 10), slice(10, 13), 13
"""Lift is thrust over mass, m/s²."""
ACCELERATION = slice(14, 17)
"""Acceleration of the body rates, rad/s²."""
_STEP_S = 0.004
_ROUNDING = 1e-6


class ResponseModel(NamedTuple):
    """Numbers of the model along p, q, r or FLU; drag is over mass."""

    time_constant_s: Array
    max_acceleration_rad_s2: Array
    acceleration_lag_s: Array
    lift_lag_s: float
    drag_1_s: Array
    gravity_m_s2: float


def response_model(vehicle: Vehicle, response: Response) -> ResponseModel:
    drag = np.zeros(3)
    if vehicle.drag is not None:
        in_plane = vehicle.drag.rotor_coefficient * len(vehicle.rotors.position_m) * vehicle.hover_speed
        drag = (np.array(vehicle.drag.linear_n_s_m) + np.array([in_plane, in_plane, 0.0])) / vehicle.body.mass_kg
    lags, limits = np.array(response.time_constant_s), np.array(response.max_acceleration_rad_s2)
    behind = np.array(response.acceleration_lag_s)
    return ResponseModel(lags, limits, behind, response.thrust_lag_s, drag, vehicle.gravity_m_s2)


def rate_command(rate: Vector, next_rate: Vector, interval_s: float, response: Response) -> Vector:
    """Return the rate commands that lead to `next_rate` in an interval, by the inverse without acceleration lag."""
    limits = (response.max_rate_rad_s, response.max_acceleration_rad_s2)
    axes = zip(rate, next_rate, response.time_constant_s, *limits, response.acceleration_lag_s, strict=True)
    p, q, r = (_rate_command(now, then, interval_s, *of) for now, then, *of in axes)
    return (p, q, r)


def _rate_command(
    now: float, then: float, interval_s: float, lag_s: float, max_rate: float, max_acceleration: float, behind_s: float
) -> float:
    change = min(max(then - now, -max_acceleration * interval_s), max_acceleration * interval_s)
    reached = interval_s / lag_s if behind_s > 0.0 else 1.0 - exp(-interval_s / lag_s)
    return min(max(now + change / reached, -max_rate), max_rate)


@compiled
def carry(y: Array, durations_s: Array, commands: Array, disturbance: Array, packed: Packed) -> Array:
    """Propagate y, (17,), through commands of `durations_s`, (n,).

    Args:
        y: Position, m, velocity, m/s, ENU; attitude, FLU to ENU; body rates, rad/s; lift, m/s²; rate acceleration,
            rad/s².
        commands: Body rates, rad/s, and lift, m/s², (n, 4).
        disturbance: Acceleration, ENU, m/s², and angular acceleration, FLU, rad/s², (6,).
        packed: The `ResponseModel`.
    """
    y = y.copy()
    model = packed[0]
    mean = np.empty(3)
    for n in range(durations_s.size):
        steps = max(1, ceil(durations_s[n] / _STEP_S - _ROUNDING))
        h = durations_s[n] / steps
        for _ in range(steps):
            for i in range(3):
                after = y[10 + i] + _change(y, i, commands[n, i], h, model) + h * disturbance[3 + i]
                mean[i] = 0.5 * (y[10 + i] + after)
                y[10 + i] = after
            lift = commands[n, 3]
            if model.lift_lag_s > 0.0:
                lift = commands[n, 3] + (y[13] - commands[n, 3]) * exp(-h / model.lift_lag_s)
            mean_lift = 0.5 * (y[13] + lift) if model.lift_lag_s > 0.0 else lift
            y[13] = lift
            _turn(y, mean, 0.5 * h)
            _push(y, mean_lift, disturbance, model.drag_1_s, model.gravity_m_s2, h)
            _turn(y, mean, 0.5 * h)
    return y


@compiled
def _change(y: Array, axis: int, command: float, h: float, model: ResponseModel) -> float:
    limit, lag_s = model.max_acceleration_rad_s2[axis], model.time_constant_s[axis]
    rate, acceleration, behind_s = y[10 + axis], y[14 + axis], model.acceleration_lag_s[axis]
    if behind_s == 0.0:
        change: float = (command - rate) * (1.0 - exp(-h / lag_s))
        change = min(max(change, -h * limit), h * limit)
        y[14 + axis] = change / h
        return change
    asked = (command - rate - 0.5 * h * acceleration) / lag_s
    asked = min(max(asked, -limit), limit)
    stays = exp(-h / behind_s)
    y[14 + axis] = asked + (acceleration - asked) * stays
    followed: float = h * asked + (acceleration - asked) * behind_s * (1.0 - stays)
    return followed


@compiled
def _turn(y: Array, rate: Array, h: float) -> None:
    w, x, a, b = y[6], y[7], y[8], y[9]
    p, q, r = 0.5 * h * rate[0], 0.5 * h * rate[1], 0.5 * h * rate[2]
    y[6] = w - x * p - a * q - b * r
    y[7] = x + w * p + a * r - b * q
    y[8] = a + w * q + b * p - x * r
    y[9] = b + w * r + x * q - a * p
    length = sqrt(y[6] * y[6] + y[7] * y[7] + y[8] * y[8] + y[9] * y[9])
    for i in range(6, 10):
        y[i] /= length


@compiled
def _push(y: Array, lift: float, disturbance: Array, drag: Array, gravity_m_s2: float, h: float) -> None:
    R = rotation_matrix((y[6], y[7], y[8], y[9]))
    along = np.empty(3)
    for i in range(3):
        along[i] = -drag[i] * (R[0][i] * y[3] + R[1][i] * y[4] + R[2][i] * y[5])
    along[2] += lift
    for i in range(3):
        a = R[i][0] * along[0] + R[i][1] * along[1] + R[i][2] * along[2] + disturbance[i]
        if i == 2:
            a -= gravity_m_s2
        y[i] += h * (y[3 + i] + 0.5 * h * a)
        y[3 + i] += h * a


_AS_TUNED_S = 0.06
"""Largest delay of a law as tuned."""
_MOST = 1.6
_WEIGHTS = {"position": -2.0, "velocity": 4.0, "rate": 6.0, "first_correction": 6.0, "next_correction": 6.0}
"""Power of the slowness in each weight."""


def delay_s(response: Response) -> float:
    """Return dead time and lag of roll and pitch rates, s; at second order the inverse undoes the rate loop."""
    pairs = zip(response.time_constant_s[:2], response.acceleration_lag_s[:2], strict=True)
    return response.latency_s + max(behind_s or lag_s for lag_s, behind_s in pairs)


def slowness(response: Response) -> float:
    """Return the factor of slowing, 1 or more."""
    return min(max(delay_s(response) / _AS_TUNED_S, 1.0), _MOST)


def lateness_s(response: Response) -> float:
    """Return the delay beyond the tuned one, s."""
    return max(delay_s(response) - _AS_TUNED_S, 0.0)


def slowed(profile: Profile, response: Response) -> Profile:
    """Slow a law down; laws with other weights are unchanged."""
    times = slowness(response)
    weights: Any = profile.table(profile.controller).get("weights")
    if times == 1.0 or not isinstance(weights, dict) or not _WEIGHTS.keys() <= weights.keys():
        return profile
    for name, power in _WEIGHTS.items():
        profile = profile.replace(f"controllers.{profile.controller}.weights.{name}", weights[name] * times**power)
    return profile
