"""Parameters of the airframe for compiled kernels."""

from math import sqrt
from typing import NamedTuple

from colibri.common.jit import compiled
from colibri.common.types import Array, Vector
from colibri.plant.vehicle.description import Vehicle


class Airframe(NamedTuple):
    """Mass, gravity and drag of a vehicle."""

    mass_kg: float
    gravity_m_s2: float
    drag_xy: float  # along body x and y, N s/m
    drag_z: float  # N s/m
    rotor_drag: float  # in-plane, all rotors, N s/m at 1 N of thrust: it grows with the thrust's root


def airframe_of(vehicle: Vehicle) -> Airframe:
    mass_kg, gravity = vehicle.body.mass_kg, vehicle.gravity_m_s2
    if vehicle.drag is None:
        return Airframe(mass_kg, gravity, 0.0, 0.0, 0.0)
    x, y, z = vehicle.drag.linear_n_s_m
    rotors = vehicle.drag.rotor_coefficient * len(vehicle.rotors.position_m)
    speed_at_1_n = (len(vehicle.rotors.position_m) * vehicle.rotors.thrust_coefficient) ** -0.5
    return Airframe(mass_kg, gravity, 0.5 * (x + y), z, rotors * speed_at_1_n)


@compiled
def drag_force(airframe: Airframe, velocity: Array | Vector, up: Array | Vector, thrust_n: float) -> Vector:
    """Return the drag, N, at `velocity`, m/s, and a thrust along `up`; all ENU."""
    along = velocity[0] * up[0] + velocity[1] * up[1] + velocity[2] * up[2]
    across = airframe.drag_xy + airframe.rotor_drag * sqrt(max(thrust_n, 0.0))
    return (
        -across * (velocity[0] - along * up[0]) - airframe.drag_z * along * up[0],
        -across * (velocity[1] - along * up[1]) - airframe.drag_z * along * up[1],
        -across * (velocity[2] - along * up[2]) - airframe.drag_z * along * up[2],
    )
