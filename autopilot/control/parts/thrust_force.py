"""The force of the thrust, N, ENU, (3,), within its limits, as compiled kernels."""

from math import sqrt
from typing import NamedTuple

from colibri.autopilot.control.vehicle_model.airframe import Airframe, drag_force
from colibri.common.jit import compiled
from colibri.common.types import Array, Vector

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
def limited_force(force: Vector, limits: ForceLimits) -> Vector:
    """Return a force within its limits: height has priority over place; without a tilt limit the direction is kept."""
    x, y, z = force
    if not limits.upright:
        total = sqrt(x * x + y * y + z * z)
        if total > limits.max_n:
            part = limits.max_n / total
            return x * part, y * part, z * part
        return force
    z = min(max(z, limits.min_up_n), limits.max_n)
    horizontal = sqrt(x * x + y * y)
    left = sqrt(max(limits.max_n * limits.max_n - z * z, 0.0))
    allowed = min(z * limits.tilt_tangent, left)
    if horizontal > allowed:
        part = allowed / horizontal
        return x * part, y * part, z
    return x, y, z


@compiled
def overcome_drag(velocities: Array, airframe: Airframe, limits: ForceLimits, forces: Array) -> None:
    """Add the force against drag at velocities, m/s, ENU, (n, 3), to forces, (n, 3), within limits."""
    for n in range(forces.shape[0]):
        x, y, z = forces[n, 0], forces[n, 1], forces[n, 2]
        velocity = (velocities[n, 0], velocities[n, 1], velocities[n, 2])
        force = limited_force((x, y, z), limits)
        for _ in range(_DRAG_PASSES):
            thrust = max(sqrt(force[0] * force[0] + force[1] * force[1] + force[2] * force[2]), LEAST_N)
            up = (force[0] / thrust, force[1] / thrust, force[2] / thrust)
            drag = drag_force(airframe, velocity, up, thrust)
            force = limited_force((x - drag[0], y - drag[1], z - drag[2]), limits)
        forces[n, 0], forces[n, 1], forces[n, 2] = force
