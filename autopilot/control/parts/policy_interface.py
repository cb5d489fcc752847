"""Observations and actions of learned policies: the same in learning environments and in flight."""

from math import isfinite, sqrt

import numpy as np
from numpy.typing import NDArray

from colibri.autopilot.control.vehicle_model.mixer import exact_inverse
from colibri.common.compiled_rotations import rotation_matrix
from colibri.common.jit import compiled
from colibri.common.types import Array, PerRotor
from colibri.plant.vehicle.description import Vehicle

FIXED = 18  # values of an observation before the last action
MAX_POSITION_M, MAX_SPEED_M_S, MAX_RATE_RAD_S = 100.0, 100.0, 100.0  # observations are clipped to these
IDLE, TOP, THRUST, RATES, INERTIA = 0, 1, 2, 3, 6
_RATE_GAIN_1_S = 20.0


def width(actions: int, preview: int, history: int) -> int:
    """Return the number of values of an observation."""
    return FIXED + 3 * preview + actions * history


def scale_of(vehicle: Vehicle, max_rates_rad_s: tuple[float, ...]) -> tuple[Array, Array]:
    """Return scale and mixer of actions: (9,), and (N, 4) from U1 to U4 to squared rotor speeds."""
    rotors, thrust_n = vehicle.rotors, float(vehicle.max_wrench()[0])
    scale = (rotors.idle_speed, rotors.max_speed, thrust_n, *max_rates_rad_s, *vehicle.body.inertia_kg_m2)
    return np.array(scale), exact_inverse(vehicle.allocation())


def level_action(speeds: PerRotor, vehicle: Vehicle, *, rates: bool) -> Array:
    """Return the action that keeps equal rotor speeds."""
    share = speeds[0] / vehicle.rotors.max_speed
    return np.array((2.0 * share * share - 1.0, 0.0, 0.0, 0.0) if rates else (2.0 * share - 1.0,) * len(speeds))


@compiled
def observe(
    x: Array, action: Array, older: Array, reference: Array, k: int, stride: int, out: NDArray[np.float32]
) -> None:
    """Write one vehicle's observation; `reference` begins with position, ENU; `older` actions are (h, a)."""
    R = rotation_matrix((x[9], x[10], x[11], x[12]))
    for i in range(3):
        velocity = R[i][0] * x[0] + R[i][1] * x[1] + R[i][2] * x[2]
        out[i] = _clipped(x[6 + i] - reference[k, i], MAX_POSITION_M)
        out[3 + i] = _clipped(velocity, MAX_SPEED_M_S)
        out[15 + i] = _clipped(x[3 + i], MAX_RATE_RAD_S)
        for j in range(3):
            out[6 + 3 * i + j] = _clipped(R[i][j], 1.0)
    size, end = action.size, out.size - older.size
    for i in range(size):
        out[FIXED + i] = action[i]
    for ahead in range((end - FIXED - size) // 3):
        for i in range(3):
            there = reference[k + (ahead + 1) * stride, i] - x[6 + i]
            out[FIXED + size + 3 * ahead + i] = _clipped(there, MAX_POSITION_M)
    for past in range(older.shape[0]):
        for i in range(size):
            out[end + size * past + i] = older[past, i]


@compiled
def take(given: Array, last: Array, older: Array) -> float:
    """Keep an action, clipped, with those before it; return its squared change, negative if it is not finite."""
    for i in range(given.size):
        if not isfinite(given[i]):
            return -1.0
    for past in range(older.shape[0] - 1, -1, -1):
        for i in range(given.size):
            older[past, i] = older[past - 1, i] if past else last[i]
    change = 0.0
    for i in range(given.size):
        action = _clipped(given[i], 1.0)
        change += (action - last[i]) * (action - last[i])
        last[i] = action
    return change


@compiled
def turn(action: Array, scale: Array, out: Array) -> None:
    """Write the rotor speeds of an action of rotors."""
    for i in range(out.size):
        out[i] = max(scale[IDLE], 0.5 * (action[i] + 1.0) * scale[TOP])


@compiled
def aim(x: Array, action: Array, mixer: Array, scale: Array, out: Array) -> None:
    """Write rotor speeds for thrust and body rates: proportional, with the gyroscopic moment compensated."""
    p, q, r = x[3], x[4], x[5]
    ix, iy, iz = scale[INERTIA], scale[INERTIA + 1], scale[INERTIA + 2]
    u1 = 0.5 * (action[0] + 1.0) * scale[THRUST]
    u2 = ix * _RATE_GAIN_1_S * (action[1] * scale[RATES] - p) + q * r * (iz - iy)
    u3 = iy * _RATE_GAIN_1_S * (action[2] * scale[RATES + 1] - q) + p * r * (ix - iz)
    u4 = iz * _RATE_GAIN_1_S * (action[3] * scale[RATES + 2] - r) + p * q * (iy - ix)
    for i in range(out.size):
        squared = mixer[i, 0] * u1 + mixer[i, 1] * u2 + mixer[i, 2] * u3 + mixer[i, 3] * u4
        out[i] = min(max(sqrt(max(squared, 0.0)), scale[IDLE]), scale[TOP])


@compiled
def _clipped(value: float, most: float) -> float:
    return min(max(value, -most), most)
