"""References that lead the vehicle to the given ones, as compiled kernels.

Samples are from now to one past the horizon, n = N + 2; positions, velocities and accelerations are (n, 3), ENU.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.lpv_mpc.model import Disturbance
from colibri.autopilot.control.parts.thrust_force import ForceLimits
from colibri.common.jit import Packed, compiled
from colibri.common.matrices import norm, put
from colibri.common.types import Array

_STRONG_WIND = 0.2  # horizontal force, in parts of the weight, beyond which errors of velocity count as distances
_STOP_S, _MAX_STOP_S, _IN_GUSTS_M_S = 10.0, 2.0, 0.3  # for each part beyond; at most; error that does not count
_CLOSING = 0.125  # least speed of an approach, in parts of the reference's
_CATCH_UP_S = 1.0  # in which an error of velocity is made good, within the accelerations
_JUMP_M_S = 0.02  # least velocity jump between references, beyond their accelerations


class Approach(NamedTuple):
    """Constants of the approach to references."""

    k1_s2: float  # on a large position error
    k2_s: float  # on its rate
    max_error_m: float  # of approach
    follow_within_m: float  # impossible motion of farther references counts in proportion
    max_acceleration_m_s2: float  # of a decaying error
    max_climb_m_s2: float  # the same upwards, and for small errors of velocity
    exact_within_m: float  # nearer references are tracked directly
    interval_s: float
    recovery_1_s2: float  # gains of the recovery, slower than plans
    recovery_1_s: float
    from_wrench: Array  # U1, N, and U2..U4, N m, to the squared speeds of m rotors, (m, 4)
    turns: bool = True  # else the yaw of references is the vehicle's


@compiled
def before_jump(references: tuple[Array, Array, Array, Array], interval_s: float) -> tuple[Array, Array, Array, Array]:
    """Return references extrapolated past a jump of the velocity, as at the end of a track.

    No vehicle follows a jump: tracking it would spoil the samples before.
    """
    position, velocity, acceleration, yaw_rad = references
    n = position.shape[0]
    for k in range(n - 1):
        jump, bent = 0.0, 0.0
        for i in range(3):
            change = acceleration[k + 1, i] - acceleration[k, i]
            along = velocity[k + 1, i] - velocity[k, i] - interval_s * (acceleration[k, i] + 0.5 * change)
            jump += along * along
            bent += change * change
        if jump > _JUMP_M_S * _JUMP_M_S and jump > interval_s * interval_s * bent:
            p, v, a, yaw = position.copy(), velocity.copy(), acceleration.copy(), yaw_rad.copy()
            for later in range(k + 1, n):
                t = (later - k) * interval_s
                yaw[later] = yaw[later - 1] + (yaw[k] - yaw[k - 1] if k else 0.0)
                for i in range(3):
                    jerk = (a[k, i] - a[k - 1, i]) / interval_s if k else 0.0
                    a[later, i] = a[k, i] + t * jerk
                    v[later, i] = v[k, i] + t * (a[k, i] + t * jerk / 2.0)
                    p[later, i] = p[k, i] + t * (v[k, i] + t * (a[k, i] / 2.0 + t * jerk / 6.0))
            return p, v, a, yaw
    return references


@compiled
def approach(
    position: Array,
    velocity: Array,
    references: tuple[Array, Array, Array],
    feasible: float,  # part of their motion
    stop_s: float,  # of `stopping_s`
    packed: Packed,
    near: tuple[Array, Array, Array],
) -> None:
    """Write references, ENU, (n, 3) each, that lead from the vehicle to the given ones.

    Near references stay as given, in strong wind only if the vehicle has about their velocity. For farther ones the
    error decays with the gains, slowed down to the largest acceleration; an error above the largest closes at constant
    speed. An impossible motion that is far away counts in part: it must not lead the vehicle astray.
    """
    law = packed[0]
    away, squared, late, speed = np.empty(3), 0.0, 0.0, norm(references[1][0])
    for i in range(3):
        away[i] = references[0][0, i] - position[i]
        squared += away[i] * away[i]
        missing = references[1][0, i] - velocity[i]
        late += missing * missing
    distance = sqrt(squared)
    reach = max(distance, stop_s * (sqrt(late) - _IN_GUSTS_M_S))
    if reach <= law.exact_within_m:
        for order in range(3):
            for n in range(references[order].shape[0]):
                put(references[order][n], near[order][n])
        return
    part = max(law.follow_within_m / max(distance, law.follow_within_m), feasible)
    smooth = 1.0 - law.exact_within_m / reach
    far_m, h = max(law.max_error_m, _CLOSING * part * speed * law.k2_s / law.k1_s2), law.interval_s
    is_far = distance > far_m
    error, error_rate, drift = np.zeros(3), np.empty(3), np.zeros(3)
    for i in range(3):
        if is_far:
            drift[i] = law.k1_s2 / law.k2_s * far_m / distance * away[i]
        else:
            error[i] = away[i]
        error_rate[i] = part * references[1][0, i] + drift[i] - velocity[i]
    most_m_s2 = min(max(sqrt(late) / _CATCH_UP_S, law.max_climb_m_s2), law.max_acceleration_m_s2)
    slower = slowed_by(error, error_rate, most_m_s2, law)
    k1, k2 = law.k1_s2 / (slower * slower), law.k2_s / slower
    for i in range(3):
        left, left_rate = smooth * error[i], smooth * error_rate[i]
        for n in range(references[0].shape[0]):
            left_acceleration = -k1 * left - k2 * left_rate
            moved = references[0][n, i] - references[0][0, i]
            near[0][n, i] = position[i] + error[i] + part * moved + drift[i] * n * h - left
            near[1][n, i] = part * references[1][n, i] + drift[i] - left_rate
            near[2][n, i] = part * references[2][n, i] - left_acceleration
            jerk = -k1 * left_rate - k2 * left_acceleration
            snap = -k1 * left_acceleration - k2 * jerk
            left += h * (left_rate + h / 2.0 * (left_acceleration + h / 3.0 * (jerk + h / 4.0 * snap)))
            left_rate += h * (left_acceleration + h / 2.0 * (jerk + h / 3.0 * snap))


@compiled
def feasible_part(
    velocity: Array, acceleration: Array, disturbance: Disturbance, limits: ForceLimits, vehicle: Packed
) -> float:
    """Return 1 for references, ENU, (n, 3), that need at most the largest thrust, and 0 from twice that thrust on."""
    airframe, worst = vehicle[0].airframe, 0.0
    drag = airframe.drag_xy + airframe.rotor_drag * sqrt(airframe.mass_kg * airframe.gravity_m_s2)
    for n in range(velocity.shape[0]):
        squared = 0.0
        for i in range(3):
            wanted = acceleration[n, i] - disturbance.acceleration[i] + (airframe.gravity_m_s2 if i == 2 else 0.0)
            force = airframe.mass_kg * wanted + drag * velocity[n, i]
            squared += force * force
        worst = max(worst, squared)
    return min(max(2.0 - sqrt(worst) / limits.max_n, 0.0), 1.0)


@compiled
def stopping_s(disturbance: Disturbance, vehicle: Packed) -> float:
    """Return the time by which an error of velocity becomes a distance: strong wind leaves less force to stop with."""
    x, y, _ = disturbance.acceleration
    strength: float = sqrt(x * x + y * y) / vehicle[0].airframe.gravity_m_s2
    return min(max(_STOP_S * (strength - _STRONG_WIND), 0.0), _MAX_STOP_S)


@compiled
def slowed_by(error: Array, rate: Array, most_m_s2: float, law: Approach) -> float:
    steep = most_m_s2 / law.max_climb_m_s2  # vertical errors count so much more
    up, up_rate = steep * error[2], steep * rate[2]
    error_m = sqrt(error[0] * error[0] + error[1] * error[1] + up * up)
    rate_m_s = sqrt(rate[0] * rate[0] + rate[1] * rate[1] + up_rate * up_rate)
    half = 0.5 * law.k2_s * rate_m_s / most_m_s2
    return max(half + sqrt(half * half + law.k1_s2 * error_m / most_m_s2), 1.0)
