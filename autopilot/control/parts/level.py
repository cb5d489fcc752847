"""The frame in which a vehicle with tilted rotors hovers level: z is along the force of its rotors without moments."""

import msgspec
import numpy as np

from colibri.autopilot.control.interface import VehicleState
from colibri.autopilot.control.vehicle_model.mixer import exact_inverse
from colibri.common.matrices import matmul, matvec, norm
from colibri.common.rotations import euler_from_quaternion, nearest_turn, quaternion_product, rotation_matrix
from colibri.common.types import Array, Quaternion, Vector
from colibri.plant.vehicle.description import Vehicle

_PASSES, _LEVEL = 6, 1e-9  # the rotors' speeds without moments depend on the frame


def levelled(vehicle: Vehicle) -> tuple[Vehicle, Quaternion | None]:
    """Return the vehicle in that frame, and the rotation from there to FLU; None if it is FLU."""
    to_body: Quaternion | None = None
    for _ in range(_PASSES):
        force = matvec(vehicle.wrenches()[:3], exact_inverse(vehicle.allocation())[:, 0].copy())
        x, y, z = (force / norm(force)).tolist()
        if x * x + y * y < _LEVEL * _LEVEL or z <= 0.0:
            break
        length = norm(np.array([1.0 + z, -y, x]))
        turn = ((1.0 + z) / length, -y / length, x / length, 0.0)
        to_body = turn if to_body is None else quaternion_product(to_body, turn)
        vehicle = _seen_from(vehicle, np.array(rotation_matrix(turn)).T.copy())
    return vehicle, to_body


def seen_level(state: VehicleState, to_body: Quaternion) -> VehicleState:
    """Return a state with its attitude and rates those of the level frame."""
    attitude = quaternion_product(state.attitude, to_body)
    phi, theta, psi = euler_from_quaternion(attitude)
    rates = matvec(np.array(rotation_matrix(to_body)).T, np.array(state.rate_flu_rad_s)).tolist()
    euler = (phi, theta, nearest_turn(psi, state.euler[2]))
    return state._replace(attitude=attitude, euler=euler, rate_flu_rad_s=(rates[0], rates[1], rates[2]))


def _seen_from(vehicle: Vehicle, turn: Array) -> Vehicle:
    body, rotors = vehicle.body, vehicle.rotors
    inertia = matmul(matmul(turn, body.inertia()), turn.T.copy())
    (x, xy, xz), (_, y, yz), (_, _, z) = inertia.tolist()
    return msgspec.structs.replace(
        vehicle,
        body=msgspec.structs.replace(
            body,
            inertia_kg_m2=(x, y, z),
            inertia_products_kg_m2=(xy, xz, yz),
            center_of_mass_m=_rows(np.array([body.center_of_mass_m]), turn)[0],
        ),
        rotors=msgspec.structs.replace(
            rotors, position_m=_rows(rotors.points_m(), turn), axis=_rows(rotors.axes(), turn)
        ),
    )


def _rows(vectors: Array, turn: Array) -> tuple[Vector, ...]:
    return tuple((x, y, z) for x, y, z in matmul(vectors, turn.T.copy()).tolist())
