"""Observer of constant disturbances: acceleration (wind) and moment (a weak rotor).

Two Luenberger observers, on velocity and body rates, with double poles. Their inputs are the rotors' forces within
limits, which prevents windup.
"""

from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.vehicle_model.airframe import Airframe, airframe_of, drag_force
from colibri.autopilot.control.vehicle_model.drag import learn_drag
from colibri.common.config import Positive, Table
from colibri.common.elementary import square
from colibri.common.jit import compiled
from colibri.common.kernels import exp
from colibri.common.matrices import put
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle

_ZERO = 1e-60  # estimates that decay below it would end as subnormal numbers, which most CPUs compute ten times slower
_NEAR_GROUND = 0.2  # of the largest moment: a larger one comes from the feet
ESTIMATES = 12  # velocity, m/s (ENU); body rates, rad/s; disturbances: acceleration, m/s² (ENU), and moment, N m
"""If drag is learned, `drag.LEARNED` numbers follow."""
MEASURED = 9  # velocity, m/s (ENU); body rates, rad/s; body z axis (ENU)


class ObserverSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The disturbance observers."""

    acceleration_rad_s: Positive
    moment_rad_s: Positive
    max_acceleration_m_s2: Positive
    max_moment_n_m: Positive


class ObserverModel(NamedTuple):
    """Gains and limits of the observers, and the vehicle."""

    velocity: float  # gain of the innovation
    acceleration: float  # gain of the disturbance, 1/s
    rate: float  # gain of the innovation
    angular_acceleration: float  # gain of the disturbance, 1/s
    max_acceleration_m_s2: float
    max_moment_n_m: float
    airframe: Airframe
    inertia: Array  # kg m², (3,)
    interval_s: float


def observer_of(settings: ObserverSettings, vehicle: Vehicle, interval_s: float) -> ObserverModel:
    return ObserverModel(
        *gains(settings.acceleration_rad_s, interval_s),
        *gains(settings.moment_rad_s, interval_s),
        settings.max_acceleration_m_s2,
        settings.max_moment_n_m,
        airframe_of(vehicle),
        np.array(vehicle.body.inertia_kg_m2),
        interval_s,
    )


def gains(frequency_rad_s: float, interval_s: float) -> tuple[float, float]:
    """Return the gains on the state and on its disturbance (1/s) for a double pole."""
    pole = exp(-frequency_rad_s * interval_s)
    return 1.0 - pole * pole, square(1.0 - pole) / interval_s


@compiled
def observe(
    estimate: Array,
    before: Array,  # measured, (9,)
    now: Array,  # measured, (9,)
    wrench: Array,  # mean over the interval, (4,)
    momentum: float,  # h of the rotors along body z, N m s
    mass_kg: float,
    observer: ObserverModel,
) -> Array:
    airframe, inertia, interval_s = observer.airframe, observer.inertia, observer.interval_s
    thrust_n, moment_n_m = wrench[0], wrench[1:]
    middle = np.empty_like(now)
    for i in range(MEASURED):
        middle[i] = 0.5 * (before[i] + now[i])
    rate, up = middle[3:6], middle[6:]
    after = np.empty_like(estimate)
    drag_n = drag_force(airframe, middle[:3], up, thrust_n)
    if estimate.shape[0] > ESTIMATES:
        put(estimate[ESTIMATES:], after[ESTIMATES:])
        unexplained = np.empty(3)
        for i in range(3):
            weight = airframe.gravity_m_s2 if i == 2 else 0.0
            unexplained[i] = (now[i] - before[i]) / interval_s + weight - thrust_n / mass_kg * up[i]
        x, y, z = learn_drag(drag_n, unexplained, up, airframe, interval_s, after[ESTIMATES:])
        drag_n = (mass_kg * x, mass_kg * y, mass_kg * z)
    turn = np.empty(3)
    ix, iy, iz = inertia[0], inertia[1], inertia[2]
    p, q, r = rate
    turn[0] = (moment_n_m[0] + (iy - iz) * q * r - momentum * q) / ix
    turn[1] = (moment_n_m[1] + (iz - ix) * p * r + momentum * p) / iy
    turn[2] = (moment_n_m[2] + (ix - iy) * p * q) / iz
    for i in range(3):
        explained = (drag_n[i] + thrust_n * up[i]) / mass_kg - (airframe.gravity_m_s2 if i == 2 else 0.0)
        expected = estimate[i] + interval_s * (explained + estimate[6 + i])
        innovation = now[i] - expected
        after[i] = expected + observer.velocity * innovation
        disturbance = estimate[6 + i] + observer.acceleration * innovation
        after[6 + i] = min(max(disturbance, -observer.max_acceleration_m_s2), observer.max_acceleration_m_s2)
        expected = estimate[3 + i] + interval_s * (turn[i] + estimate[9 + i] / inertia[i])
        innovation = now[3 + i] - expected
        after[3 + i] = expected + observer.rate * innovation
        disturbance = estimate[9 + i] + observer.angular_acceleration * innovation * inertia[i]
        after[9 + i] = min(max(disturbance, -observer.max_moment_n_m), observer.max_moment_n_m)
    for i in range(ESTIMATES):
        if abs(after[i]) < _ZERO:
            after[i] = 0.0
    return after


@compiled
def limit_near_ground(estimate: Array, before: Array, observer: ObserverModel) -> None:
    """Limit the lift and the moments: those of the feet end with the take-off. Drag is learned in the air."""
    put(before[ESTIMATES:], estimate[ESTIMATES:])
    estimate[8] = min(estimate[8], max(before[8], _NEAR_GROUND * observer.max_acceleration_m_s2))
    for i in range(9, ESTIMATES):
        most = max(abs(before[i]), _NEAR_GROUND * observer.max_moment_n_m)
        estimate[i] = min(max(estimate[i], -most), most)
