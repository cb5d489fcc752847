"""Geometry of the scene, as pure functions of arrays."""

from collections.abc import Sequence
from math import cos, hypot, isfinite, isnan, pi, sin
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from colibri.common.types import Array, PerRotor, Quaternion, Vector
from colibri.view.snapshot import Mark, Surroundings, VehicleShape, Zone

Colour: TypeAlias = tuple[int, int, int]

IDLE_GREY: Colour = (150, 150, 150)
_SCALE: tuple[tuple[float, Colour], ...] = (
    (0.0, (40, 90, 200)),
    (0.4, (40, 180, 160)),
    (0.7, (240, 200, 40)),
    (1.0, (220, 40, 40)),
)
_MAX_ARROW = 3.0  # length of an arrow at top speed, in radii of the rotor
_TURNS_A_SECOND = 1.5  # displayed rate at top speed; the true one would alias
_EDGES = 4  # upright lines of a circular zone


def rotor_colour(part: float) -> Colour:
    if not isfinite(part):
        return IDLE_GREY
    levels, colours = zip(*_SCALE, strict=True)
    red, green, blue = (round(float(np.interp(part, levels, channel))) for channel in zip(*colours, strict=True))
    return red, green, blue


def blade_angles(rotors: PerRotor, spins: PerRotor, before_rad: PerRotor, elapsed_s: float) -> PerRotor:
    full = 2.0 * pi * _TURNS_A_SECOND * elapsed_s
    return tuple(
        (angle + full * spin * (0.0 if isnan(part) else part)) % (2.0 * pi)
        for angle, spin, part in zip(before_rad, spins, rotors, strict=True)
    )


def about_up(angle_rad: float) -> Quaternion:
    """Return the rotation about the z axis."""
    return cos(angle_rad / 2.0), 0.0, 0.0, sin(angle_rad / 2.0)


def thrust_arrows(airframe: VehicleShape, rotors: PerRotor, scale: float) -> Array:
    """Return thrust arrows, FLU, m times scale, (N, 2, 3)."""
    arrows = np.zeros((len(airframe.rotors_m), 2, 3))
    arrows[:, :, :2] = scale * np.array(airframe.rotors_m)[:, None, :]
    lengths = np.nan_to_num(np.square(rotors)) * _MAX_ARROW * airframe.radius_m * scale
    arrows[:, 1, 2] = np.maximum(lengths, 1e-6)
    return arrows


def segments(points: Array) -> NDArray[np.float32]:
    """Join points (n, 3) to segments; non-finite points interrupt the line."""
    joined = np.stack([points[:-1], points[1:]], axis=1).astype(np.float32)
    return joined[np.isfinite(joined).all(axis=(1, 2))]


def thinned(points: Array, most: int) -> Array:
    """Return at most `most` + 1 of points (n, 3), with the last."""
    step = -(-len(points) // most) if len(points) > most else 1
    return points[::-1][::step][::-1]


def zone_segments(zone: Zone, bottom_m: float, top_m: float) -> NDArray[np.float32]:
    """Return a zone's outline at two heights and its edges, (n, 2, 3)."""
    closed = np.vstack([zone.corners_m, zone.corners_m[:1]])
    rings = [np.column_stack([closed, np.full(len(closed), height)]) for height in (bottom_m, top_m)]
    corners = len(zone.corners_m)
    edges = list(range(corners)) if corners <= 3 * _EDGES else [corners * k // _EDGES for k in range(_EDGES)]
    upright = np.stack([rings[0][edges], rings[1][edges]], axis=1).astype(np.float32)
    return np.concatenate([segments(rings[0]), segments(rings[1]), upright])


def circle(east_m: float, north_m: float, radius_m: float, corners: int = 48) -> Array:
    """Return a circle's outline, (corners, 2)."""
    angles = np.linspace(0.0, 2.0 * pi, corners, endpoint=False)
    return np.column_stack([east_m + radius_m * np.cos(angles), north_m + radius_m * np.sin(angles)])


def ground_point(origin: Vector, direction: Vector, ground_m: float) -> Vector | None:
    """Return where a ray meets the ground, if it points down."""
    if direction[2] >= 0.0 or origin[2] <= ground_m:
        return None
    far = (ground_m - origin[2]) / direction[2]
    return origin[0] + far * direction[0], origin[1] + far * direction[1], ground_m


def bounds(points: Sequence[Array]) -> tuple[Vector, float]:
    """Return centre and half size, 2 m or more, of the box around points (n, 3)."""
    known = [each[np.isfinite(each).all(axis=1)] for each in points]
    filled = [each for each in known if len(each)]
    if not filled:
        return (0.0, 0.0, 1.0), 2.0
    low = np.min([each.min(axis=0) for each in filled], axis=0)
    high = np.max([each.max(axis=0) for each in filled], axis=0)
    x, y, z = ((low + high) / 2.0).tolist()
    return (x, y, z), max(2.0, float((high - low).max()) / 2.0)


def outline(around: Surroundings) -> list[Array]:
    """Return the points to be seen, (n, 3) each."""
    marks = [*around.mission, *around.rally, Mark(around.home_enu_m, "home")]
    zones = [np.column_stack([zone.corners_m, np.full(len(zone.corners_m), around.ground_m)]) for zone in around.fence]
    return [around.path, around.reference_path, np.array([mark.place_enu_m for mark in marks]), *zones]


def vehicle_scale(extent_m: float, airframe: VehicleShape) -> float:
    size = max(hypot(*place) for place in airframe.rotors_m) + airframe.radius_m
    return max(1.0, round(0.2 * extent_m / size, 1))


def arrow(place: Vector, vector: Vector, scale: float) -> Array | None:
    """Return an arrow, (1, 2, 3), unless it is of zero or unknown length."""
    tip = np.array(place) + scale * np.array(vector)
    if not np.isfinite(tip).all() or np.linalg.norm(vector) < 1e-3:
        return None
    return np.array([[place, tip]])
