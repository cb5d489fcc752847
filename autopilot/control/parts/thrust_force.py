"""The force that the thrust must make, within its limits, as compiled kernels. Forces are in N, ENU, (3,)."""

from math import sqrt
from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.vehicle_model.airframe import Airframe, drag_force
from colibri.common.jit import compiled
from colibri.common.matrices import norm, put
from colibri.common.types import Array

_DRAG_PASSES = 2
"""Drag depends on the direction of the force that has to overcome it."""


class ForceLimits(NamedTuple):
    """Limits of the force that is asked of the thrust.

    Attributes:
        tilt_tangent: Tangent of its largest tilt.
        min_n, max_n: Least and largest thrust, N.
        min_up_n: Least vertical part, N, where references ask: less would have no direction to speak of.
    """

    tilt_tangent: float
    min_n: float
    max_n: float
    min_up_n: float


@compiled
def limit_force(force: Array, limits: ForceLimits) -> None:
    """Limit a force in place, its vertical part first: height before place."""
    force[2] = min(max(force[2], limits.min_up_n), limits.max_n)
    horizontal = sqrt(force[0] * force[0] + force[1] * force[1])
    left = sqrt(max(limits.max_n * limits.max_n - force[2] * force[2], 0.0))
    allowed = min(force[2] * limits.tilt_tangent, left)
    if horizontal > allowed:
        force[0] *= allowed / horizontal
        force[1] *= allowed / horizontal


@compiled
def overcome_drag(velocities: Array, airframe: Airframe, limits: ForceLimits, forces: Array) -> None:
    """Make forces, (n, 3), that would do without drag those that do with it, at velocities, m/s, ENU, (n, 3)."""
    free = np.empty(3)
    for n in range(forces.shape[0]):
        force = forces[n]
        put(force, free)
        limit_force(force, limits)
        for _ in range(_DRAG_PASSES):
            thrust = norm(force)
            up = (force[0] / thrust, force[1] / thrust, force[2] / thrust)
            drag = drag_force(airframe, velocities[n], up, thrust)
            for i in range(3):
                force[i] = free[i] - drag[i]
            limit_force(force, limits)
