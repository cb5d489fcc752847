"""Check that the plant's fixed step can integrate a vehicle on the ground, by the poles of its contact points."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle, VehicleError

_MAX_RATE_RAD_S = 2500.0  # Runge-Kutta 4 in steps of 1 ms is stable up to 2785
_ROUNDED = 0.994  # a value in three digits that is this part of another is not above it
_BISECTIONS = 40


class _Hardness(NamedTuple):
    stiffness_n_m: float
    damping_n_s_m: float
    slip_damping_n_s_m: float


@lru_cache(maxsize=4)
def check_contact(vehicle: Vehicle) -> None:
    """Raise a VehicleError with the largest valid values if the ground is too hard for the plant's step."""
    ground = vehicle.ground
    if ground is None:
        return
    hardness = _Hardness(ground.stiffness_n_m, ground.damping_n_s_m, ground.slip_damping_n_s_m)
    if _max_rate(vehicle, hardness) <= _MAX_RATE_RAD_S:
        return
    alone = {key: _Hardness(0.0, 0.0, 0.0)._replace(**{key: value}) for key, value in hardness._asdict().items()}
    keys = [key for key, only in alone.items() if _max_rate(vehicle, only) > _MAX_RATE_RAD_S] or hardness._fields[1:]
    fits, too_large = 0.0, 1.0
    for _ in range(_BISECTIONS):
        part = 0.5 * (fits + too_large)
        scaled = hardness._replace(**{key: part * getattr(hardness, key) for key in keys})
        fits, too_large = (part, too_large) if _max_rate(vehicle, scaled) <= _MAX_RATE_RAD_S else (fits, part)
    values = [(f"ground.{key}", getattr(hardness, key)) for key in keys]
    said = ", ".join(f"{key} {value:g} is too large, at most {_ROUNDED * fits * value:.3g}" for key, value in values)
    farthest_m = float(np.abs(vehicle.contacts_m()).max())
    raise VehicleError(
        f"{said}, for the plant's step of 1 ms with feet and rotors {farthest_m:g} m from the centre and this inertia; "
        "or leave the ground out: --without ground"
    )


def _max_rate(vehicle: Vehicle, hardness: _Hardness) -> float:
    """Return a bound on the poles, rad/s, of the vehicle on its feet and on its rotors."""
    assert vehicle.ground is not None
    inertia = np.diag([vehicle.body.mass_kg] * 6)
    inertia[3:, 3:] = vehicle.body.inertia()
    points_m, feet = vehicle.contacts_m(), len(vehicle.ground.foot_position_m)
    stiffness, normal, slip = hardness
    rates = []
    for contacts_m in (points_m[:feet], points_m[feet:]):
        damping = np.linalg.solve(inertia, _contact_matrix(contacts_m, (slip, slip, normal)))
        spring = np.linalg.solve(inertia, _contact_matrix(contacts_m, (0.0, 0.0, stiffness)))
        rates += [np.abs(np.linalg.eigvals(damping)).max(), np.sqrt(np.abs(np.linalg.eigvals(spring)).max())]
    return float(max(rates))


def _contact_matrix(contacts_m: Array, along_axes: tuple[float, float, float]) -> Array:
    """Return the 6 x 6 matrix from a small motion (m, rad) of the body to the force and moment against it."""
    matrix, weights = np.zeros((6, 6)), np.array(along_axes)[:, None, None]
    for x, y, z in contacts_m:
        motion = np.array([[1.0, 0.0, 0.0, 0.0, z, -y], [0.0, 1.0, 0.0, -z, 0.0, x], [0.0, 0.0, 1.0, y, -x, 0.0]])
        matrix += (weights * motion[:, :, None] * motion[:, None, :]).sum(axis=0)
    return matrix
