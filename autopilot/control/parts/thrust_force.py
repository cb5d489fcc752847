"""The force of the thrust, N, ENU, (3,), within its limits, as compiled kernels."""

from math import sqrt
from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.vehicle_model.airframe import Airframe, drag_force
from colibri.common.jit import compiled
from colibri.common.matrices import norm, put
from colibri.common.types import Array

LEAST_N = 1e-9  # below, a force has no direction
_DRAG_PASSES = 2  # drag depends on the direction of the force against it


class ForceLimits(NamedTuple):
    """Limits of the demanded force."""

    upright: bool  # False: thrust may point anywhere
    tilt_tangent: float  # of the largest tilt, if upright
    min_n: float
    max_n: float
    min_up_n: float  # of references: a smaller vertical force has no useful direction


@compiled
def limit_force(force: Array, limits: ForceLimits) -> None:
    """Limit a force in place. Height has priority over position; without a tilt limit the direction is kept."""
    if not limits.upright:
        total = norm(force)
        if total > limits.max_n:
            for i in range(3):
                force[i] *= limits.max_n / total
        return
    force[2] = min(max(force[2], limits.min_up_n), limits.max_n)
    horizontal = sqrt(force[0] * force[0] + force[1] * force[1])
    left = sqrt(max(limits.max_n * limits.max_n - force[2] * force[2], 0.0))
    allowed = min(force[2] * limits.tilt_tangent, left)
    if horizontal > allowed:
        force[0] *= allowed / horizontal
        force[1] *= allowed / horizontal


@compiled
def overcome_drag(velocities: Array, airframe: Airframe, limits: ForceLimits, forces: Array) -> None:
    """Add the force against drag at velocities, m/s, ENU, (n, 3), to forces, (n, 3), within limits."""
    free = np.empty(3)
    for n in range(forces.shape[0]):
        force = forces[n]
        put(force, free)
        limit_force(force, limits)
        for _ in range(_DRAG_PASSES):
            thrust = max(norm(force), LEAST_N)
            up = (force[0] / thrust, force[1] / thrust, force[2] / thrust)
            drag = drag_force(airframe, velocities[n], up, thrust)
            for i in range(3):
                force[i] = free[i] - drag[i]
            limit_force(force, limits)
