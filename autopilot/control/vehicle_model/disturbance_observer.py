"""What the model does not explain: constant acceleration (wind, a wrong mass) and moment (a weak rotor), observed.

A Luenberger observer on the velocity and one on the body rates, each with its disturbance as a further state and both
poles at one place. They are driven by what the rotors really did, within their limits, so nothing winds up.
"""

from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.vehicle_model.airframe import Airframe
from colibri.common.elementary import square
from colibri.common.jit import compiled
from colibri.common.kernels import exp
from colibri.common.types import Array

ESTIMATES = 12
"""Velocity, m/s (ENU); body rates, rad/s; disturbances: acceleration, m/s² (ENU), and moment, N m."""
MEASURED = 9
"""Velocity, m/s (ENU); body rates, rad/s; body z axis (ENU)."""


class Observer(NamedTuple):
    """Gains on the velocity and its disturbance, on the rate and its disturbance; the most believed of each.

    Attributes:
        velocity: Part of a velocity missed that is corrected at once.
        acceleration: Disturbance for each m/s missed, 1/s.
        rate: Part of a rate missed that is corrected at once.
        angular_acceleration: Disturbance for each rad/s missed, 1/s.
        max_acceleration_m_s2: Largest acceleration believed.
        max_moment_n_m: Largest moment believed.
    """

    velocity: float
    acceleration: float
    rate: float
    angular_acceleration: float
    max_acceleration_m_s2: float
    max_moment_n_m: float


def gains(frequency_rad_s: float, interval_s: float) -> tuple[float, float]:
    """Return the gains, on what is observed and on its disturbance (1/s), of an observer with both poles there."""
    pole = exp(-frequency_rad_s * interval_s)
    return 1.0 - pole * pole, square(1.0 - pole) / interval_s


def first_estimate(measured: Array) -> Array:
    """Return the estimate (12,) of an observer that has seen no disturbance yet."""
    return np.concatenate([measured[:6], np.zeros(6)])


@compiled
def observe(
    estimate: Array,
    before: Array,
    now: Array,
    thrust_n: float,
    moment_n_m: Array,
    momentum: float,
    drag_n: Array,
    airframe: Airframe,
    inertia: Array,
    observer: Observer,
    interval_s: float,
) -> Array:
    """Return the estimate (12,) now, from that of the sample before.

    Args:
        estimate: Then, (12,).
        before: Measured then, (9,).
        now: Measured now, (9,).
        thrust_n: Its mean over the interval, N.
        moment_n_m: Its mean over the interval, FLU, (3,).
        momentum: h of the rotors along body z, N m s.
        drag_n: Its mean over the interval, ENU, (3,).
        airframe: The vehicle.
        inertia: Ix, Iy, Iz, kg m², (3,).
        observer: Gains and limits.
        interval_s: Between the two.
    """
    middle = 0.5 * (before + now)
    rate, up = middle[3:6], middle[6:]
    turn = np.empty(3)
    ix, iy, iz = inertia
    p, q, r = rate
    turn[0] = (moment_n_m[0] + (iy - iz) * q * r - momentum * q) / ix
    turn[1] = (moment_n_m[1] + (iz - ix) * p * r + momentum * p) / iy
    turn[2] = (moment_n_m[2] + (ix - iy) * p * q) / iz
    after = np.empty(ESTIMATES)
    for i in range(3):
        explained = (drag_n[i] + thrust_n * up[i]) / airframe.mass_kg - (airframe.gravity_m_s2 if i == 2 else 0.0)
        expected = estimate[i] + interval_s * (explained + estimate[6 + i])
        missed = now[i] - expected
        after[i] = expected + observer.velocity * missed
        disturbance = estimate[6 + i] + observer.acceleration * missed
        after[6 + i] = min(max(disturbance, -observer.max_acceleration_m_s2), observer.max_acceleration_m_s2)
        expected = estimate[3 + i] + interval_s * (turn[i] + estimate[9 + i] / inertia[i])
        missed = now[3 + i] - expected
        after[3 + i] = expected + observer.rate * missed
        disturbance = estimate[9 + i] + observer.angular_acceleration * missed * inertia[i]
        after[9 + i] = min(max(disturbance, -observer.max_moment_n_m), observer.max_moment_n_m)
    return after
