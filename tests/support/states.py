"""States and references of a vehicle, as control laws and guidance are told them."""

import numpy as np

from colibri.autopilot.control.interface import Horizon, VehicleState
from colibri.common.jit import Packed
from colibri.common.rotations import euler_from_quaternion, quaternion_from_euler
from colibri.common.types import Array, PerRotor, Vector
from colibri.plant.physics.equations import write_derivative
from colibri.plant.physics.world import World, state_frame

_NOTHING: Vector = (0.0, 0.0, 0.0)


def turned(
    phi: float, theta: float = 0.0, psi: float = 0.0, *, position: Vector = _NOTHING, rate: Vector = _NOTHING
) -> VehicleState:
    """Return a vehicle at Euler angles, rad; of the yaw also full turns count."""
    q = quaternion_from_euler(phi, theta, psi)
    return VehicleState(position, _NOTHING, q, (*euler_from_quaternion(q)[:2], psi), rate)


def state_of(world: World) -> VehicleState:
    frame = state_frame(world)
    euler = euler_from_quaternion(frame.attitude)
    return VehicleState(frame.position_enu_m, frame.velocity_enu_m_s, frame.attitude, euler, frame.rate_flu_rad_s)


def staying(samples: int) -> Horizon:
    nowhere, east = np.zeros((samples, 3)), np.zeros(samples)
    return Horizon(nowhere, nowhere, nowhere, nowhere, nowhere, east, east, east)


def derivative(x: Array, target: PerRotor, parameters: Packed) -> Array:
    """Return x' of the plant's equations."""
    change = np.empty_like(x)
    write_derivative(change, x, target, parameters[0])
    return change
