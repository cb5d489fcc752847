"""A simple law by which other autopilots than Colibri hover, in NED and FRD and with rotors numbered as theirs."""

from typing import NamedTuple, TypeAlias

import numpy as np

from colibri.common.rotations import rotation_matrix
from colibri.common.types import Array

Point: TypeAlias = tuple[float, float, float]


class Airframe(NamedTuple):
    """What a stranger knows of the vehicle."""

    mass_kg: float
    inertia_kg_m2: Point
    motors: tuple[Point, Point, Point, Point]  # m forward, m to the right, drag torque about down in m per N of thrust


class Known(NamedTuple):
    """What a stranger knows of the flight: NED, FRD."""

    position_m: Array
    velocity_m_s: Array
    quaternion: Array
    rate_rad_s: Array


def hovering(airframe: Airframe, known: Known, target_ned_m: Point) -> Array:
    """Return the thrust of each motor, N, that flies the vehicle to a point, looking north."""
    w, x, y, z = known.quaternion.tolist()
    R = np.array(rotation_matrix((w, x, y, z)))
    wanted = np.clip(np.array(target_ned_m) - known.position_m, -1.0, 1.0) * 1.5 - known.velocity_m_s
    force = airframe.mass_kg * (2.0 * wanted - np.array([0.0, 0.0, 9.81]))
    thrust_n = max(0.0, float(-force @ R[:, 2]))
    down = -force / np.linalg.norm(force)
    right = np.cross(down, [1.0, 0.0, 0.0])
    right /= np.linalg.norm(right)
    aimed = np.stack([np.cross(right, down), right, down], axis=1)
    twist = 0.5 * (aimed.T @ R - R.T @ aimed)
    error = np.array([twist[2, 1], twist[0, 2], twist[1, 0]])
    moment = np.array(airframe.inertia_kg_m2) * (-64.0 * error - 16.0 * known.rate_rad_s)
    forward, starboard, turn = np.array(airframe.motors).T
    thrusts: Array = np.linalg.solve(np.array([np.ones(4), -starboard, forward, turn]), [thrust_n, *moment])
    return np.maximum(0.0, thrusts)
