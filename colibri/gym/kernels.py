"""One control interval of many vehicles, compiled: rotor commands, motion, observation, reward and end."""

from math import isfinite, sqrt

import numpy as np
from numpy.typing import NDArray

from colibri.common.compiled_rotations import rotation_matrix
from colibri.common.jit import Packed, compiled
from colibri.common.types import Array, PerRotor
from colibri.plant.physics.equations import close_attitude
from colibri.plant.physics.integrators import runge_kutta_4

FAR, GROUND, NOT_FINITE, BAD_ACTION = 1, 2, 3, 4
FIXED = 22
"""Values of an observation before its preview."""
MAX_POSITION_M, MAX_SPEED_M_S, MAX_RATE_RAD_S = 100.0, 100.0, 100.0
"""Observations are clipped to these."""
IDLE, TOP, THRUST, RATES = 0, 1, 2, 3
_RATE_GAIN_1_S = 20.0
_LOST = -10.0


@compiled
def observe(x: Array, action: Array, reference: Array, k: int, stride: int, out: NDArray[np.float32]) -> None:
    """Write one vehicle's observation; `reference` is (m, 6): position and velocity, ENU."""
    R = rotation_matrix((x[9], x[10], x[11], x[12]))
    for i in range(3):
        velocity = R[i][0] * x[0] + R[i][1] * x[1] + R[i][2] * x[2]
        out[i] = _clipped(x[6 + i] - reference[k, i], MAX_POSITION_M)
        out[3 + i] = _clipped(velocity, MAX_SPEED_M_S)
        out[15 + i] = _clipped(x[3 + i], MAX_RATE_RAD_S)
        for j in range(3):
            out[6 + 3 * i + j] = _clipped(R[i][j], 1.0)
    for i in range(4):
        out[18 + i] = action[i]
    for ahead in range((out.size - FIXED) // 3):
        for i in range(3):
            there = reference[k + (ahead + 1) * stride, i] - x[6 + i]
            out[FIXED + 3 * ahead + i] = _clipped(there, MAX_POSITION_M)


@compiled
def advance(
    x: Array,
    actions: Array,
    last: Array,
    steps: NDArray[np.int64],
    flying: NDArray[np.bool_],
    parameters: Packed,
    mixers: Array,
    scales: Array,
    reference: Array,
    stride: int,
    with_rates: bool,
    duration_s: float,
    substeps: int,
    limit_m: float,
    floor_m: float,
    observations: NDArray[np.float32],
    rewards: Array,
    ends: NDArray[np.int64],
) -> None:
    """Advance the vehicles that are `flying`, in place; each row depends on itself alone.

    Args:
        x: States, (n, 18), as in `plant.physics.equations`.
        actions: -1 to 1, (n, 4).
        last: The actions before, (n, 4).
        steps: Control intervals flown, (n,).
        mixers: From U1 to U4 to squared rotor speeds, (n, 4, 4).
        scales: Idle and top speed, largest thrust (N), largest p, q, r (rad/s), (n, 6).
        reference: Position and velocity at each interval, ENU, (m, 6).
        stride: Intervals between two previewed positions.
        ends: 0, or the reason of the end, (n,).
    """
    end, action = np.empty(x.shape[1]), np.empty(4)
    for n in range(x.shape[0]):
        ends[n], rewards[n] = 0, 0.0
        if not flying[n]:
            continue
        numbers, change = parameters[n : n + 1], 0.0
        is_finite = True
        for i in range(4):
            is_finite &= isfinite(actions[n, i])
            action[i] = _clipped(actions[n, i], 1.0)
        steps[n] += 1
        k = steps[n]
        if not is_finite:
            ends[n], rewards[n] = BAD_ACTION, _LOST
            observe(x[n], last[n], reference, k, stride, observations[n])
            continue
        for i in range(4):
            change += (action[i] - last[n, i]) * (action[i] - last[n, i])
            last[n, i] = action[i]
        if with_rates:
            for _ in range(substeps):
                target = _rate_targets(x[n], action, numbers, mixers[n], scales[n])
                runge_kutta_4(x[n], target, numbers, duration_s / substeps, 1, end)
                x[n, :] = end
        else:
            idle, top = scales[n, IDLE], scales[n, TOP]
            target = (
                max(idle, 0.5 * (action[0] + 1.0) * top),
                max(idle, 0.5 * (action[1] + 1.0) * top),
                max(idle, 0.5 * (action[2] + 1.0) * top),
                max(idle, 0.5 * (action[3] + 1.0) * top),
            )
            runge_kutta_4(x[n], target, numbers, duration_s, substeps, end)
            x[n, :] = end
        if not close_attitude(x[n]):
            ends[n], rewards[n] = NOT_FINITE, _LOST
            continue
        observe(x[n], last[n], reference, k, stride, observations[n])
        R = rotation_matrix((x[n, 9], x[n, 10], x[n, 11], x[n, 12]))
        distance, slip, rate = 0.0, 0.0, 0.0
        for i in range(3):
            away = x[n, 6 + i] - reference[k, i]
            wrong = R[i][0] * x[n, 0] + R[i][1] * x[n, 1] + R[i][2] * x[n, 2] - reference[k, 3 + i]
            distance += away * away
            slip += wrong * wrong
            rate += x[n, 3 + i] * x[n, 3 + i]
        rewards[n] = 1.0 / (1.0 + 4.0 * distance) - 0.02 * sqrt(slip) - 0.01 * sqrt(rate) - 0.02 * change
        if x[n, 8] < floor_m:
            ends[n] = GROUND
        elif distance > limit_m * limit_m:
            ends[n] = FAR
        if ends[n] != 0:
            rewards[n] = _LOST


@compiled
def _rate_targets(x: Array, action: Array, parameters: Packed, mixer: Array, scale: Array) -> PerRotor:
    """Return rotor speeds for thrust and body rates: proportional, with the gyroscopic moment compensated."""
    p, q, r = x[3], x[4], x[5]
    inertia = parameters[0].inertia_kg_m2
    ix, iy, iz = inertia[0], inertia[1], inertia[2]
    u1 = 0.5 * (action[0] + 1.0) * scale[THRUST]
    u2 = ix * _RATE_GAIN_1_S * (action[1] * scale[RATES] - p) + q * r * (iz - iy)
    u3 = iy * _RATE_GAIN_1_S * (action[2] * scale[RATES + 1] - q) + p * r * (ix - iz)
    u4 = iz * _RATE_GAIN_1_S * (action[3] * scale[RATES + 2] - r) + p * q * (iy - ix)
    return (
        _speed(mixer[0], u1, u2, u3, u4, scale),
        _speed(mixer[1], u1, u2, u3, u4, scale),
        _speed(mixer[2], u1, u2, u3, u4, scale),
        _speed(mixer[3], u1, u2, u3, u4, scale),
    )


@compiled
def _speed(row: Array, u1: float, u2: float, u3: float, u4: float, scale: Array) -> float:
    squared: float = row[0] * u1 + row[1] * u2 + row[2] * u3 + row[3] * u4
    speed: float = min(max(sqrt(max(squared, 0.0)), scale[IDLE]), scale[TOP])
    return speed


@compiled
def _clipped(value: float, most: float) -> float:
    return min(max(value, -most), most)
