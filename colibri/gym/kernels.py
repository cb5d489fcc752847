"""One control interval of many vehicles, compiled: rotor commands, motion, observation, reward and end."""

from math import isfinite, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colibri.common.compiled_rotations import rotation_matrix
from colibri.common.jit import Packed, compiled
from colibri.common.types import Array, Vector
from colibri.plant.physics.equations import close_attitude
from colibri.plant.physics.integrators import runge_kutta_4

FAR, GROUND, NOT_FINITE, BAD_ACTION, DISARMED, MISSED, FINISHED = 1, 2, 3, 4, 5, 6, 7
FIXED = 18
"""Values of an observation before the last action."""
MAX_POSITION_M, MAX_SPEED_M_S, MAX_RATE_RAD_S = 100.0, 100.0, 100.0
"""Observations are clipped to these."""
IDLE, TOP, THRUST, RATES = 0, 1, 2, 3
_RATE_GAIN_1_S = 20.0
LOST, PASSED = -10.0, 10.0
"""Rewards of a lost vehicle, and of a gate."""


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
def judge(x: Array, change: float, reference: Array, k: int, limit_m: float, floor_m: float) -> tuple[float, int]:
    """Return reward, and 0 or the reason of the end, of a vehicle that follows `reference`, (m, 6)."""
    R = rotation_matrix((x[9], x[10], x[11], x[12]))
    distance, slip, rate = 0.0, 0.0, 0.0
    for i in range(3):
        away = x[6 + i] - reference[k, i]
        wrong = R[i][0] * x[0] + R[i][1] * x[1] + R[i][2] * x[2] - reference[k, 3 + i]
        distance += away * away
        slip += wrong * wrong
        rate += x[3 + i] * x[3 + i]
    if x[8] < floor_m:
        return LOST, GROUND
    if distance > limit_m * limit_m:
        return LOST, FAR
    return 1.0 / (1.0 + 4.0 * distance) - 0.02 * sqrt(slip) - 0.01 * sqrt(rate) - 0.02 * change, 0


@compiled
def judge_race(
    x: Array, before: Vector, change: float, gates: Array, k: int, gate_m: float, limit_m: float, floor_m: float
) -> tuple[float, int, int]:
    """Return reward, end and gates passed of a vehicle that was at `before`, ENU; gate k is the next.

    Args:
        gates: Centre and direction, ENU, and distance from the gate before, m, (m, 7); the last has length 0.
    """
    begun, now, ahead, behind, rate = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        was, away = before[i] - gates[k, i], x[6 + i] - gates[k, i]
        begun, now = begun + was * was, now + away * away
        behind, ahead = behind + was * gates[k, 3 + i], ahead + away * gates[k, 3 + i]
        rate += x[3 + i] * x[3 + i]
    if x[8] < floor_m:
        return LOST, GROUND, k
    reward = sqrt(begun) - sqrt(now) - 0.001 * sqrt(rate) - 0.002 * change
    if behind < 0.0 and ahead >= 0.0:
        off, share = 0.0, behind / (behind - ahead)
        for i in range(3):
            was, away = before[i] - gates[k, i], x[6 + i] - gates[k, i]
            off += (was + share * (away - was)) ** 2
        if off > gate_m * gate_m:
            return LOST, MISSED, k
        return reward + PASSED, FINISHED if gates[k + 1, 6] == 0.0 else 0, k + 1
    if sqrt(now) > gates[k, 6] + limit_m:
        return LOST, FAR, k
    return reward, 0, k


@compiled
def advance(
    x: Array,
    actions: Array,
    last: Array,
    older: Array,
    steps: NDArray[np.int64],
    passed: NDArray[np.int64],
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
    gate_m: float,
    observations: NDArray[np.float32],
    rewards: Array,
    ends: NDArray[np.int64],
) -> None:
    """Advance the vehicles that are `flying`, in place; each row depends on itself alone.

    Args:
        x: States, (n, 18), as in `plant.physics.equations`.
        actions: -1 to 1, (n, a): a number for each rotor, or four.
        last: The actions before, (n, a).
        older: Those before them, newest first, (n, h, a).
        steps: Control intervals flown, (n,).
        passed: Gates passed, (n,).
        mixers: From U1 to U4 to squared rotor speeds, (n, N, 4).
        scales: Idle and top speed, largest thrust (N), largest p, q, r (rad/s), (n, 6).
        reference: Position and velocity at each interval, ENU, (m, 6); or gates, as of `judge_race`.
        stride: Intervals between two previewed positions.
        gate_m: Radius of gates; 0: follow the reference.
        ends: 0, or the reason of the end, (n,).
    """
    end = np.empty(x.shape[1])
    target: Any = np.empty(mixers.shape[1])
    for n in range(x.shape[0]):
        ends[n], rewards[n] = 0, 0.0
        if not flying[n]:
            continue
        numbers, before = parameters[n : n + 1], (x[n, 6], x[n, 7], x[n, 8])
        steps[n] += 1
        change = take(actions[n], last[n], older[n])
        if change < 0.0:
            ends[n], rewards[n] = BAD_ACTION, LOST
            k = passed[n] if gate_m > 0.0 else steps[n]
            observe(x[n], last[n], older[n], reference, k, stride, observations[n])
            continue
        action = last[n]
        if with_rates:
            for _ in range(substeps):
                _aim(x[n], action, numbers, mixers[n], scales[n], target)
                runge_kutta_4(x[n], target, numbers, duration_s / substeps, 1, end)
                x[n, :] = end
        else:
            idle, top = scales[n, IDLE], scales[n, TOP]
            for i in range(target.size):
                target[i] = max(idle, 0.5 * (action[i] + 1.0) * top)
            runge_kutta_4(x[n], target, numbers, duration_s, substeps, end)
            x[n, :] = end
        if not close_attitude(x[n]):
            ends[n], rewards[n] = NOT_FINITE, LOST
            continue
        if gate_m > 0.0:
            rewards[n], ends[n], passed[n] = judge_race(
                x[n], before, change, reference, passed[n], gate_m, limit_m, floor_m
            )
            observe(x[n], last[n], older[n], reference, passed[n], 1, observations[n])
        else:
            rewards[n], ends[n] = judge(x[n], change, reference, steps[n], limit_m, floor_m)
            observe(x[n], last[n], older[n], reference, steps[n], stride, observations[n])


@compiled
def _aim(x: Array, action: Array, parameters: Packed, mixer: Array, scale: Array, out: Array) -> None:
    """Write rotor speeds for thrust and body rates: proportional, with the gyroscopic moment compensated."""
    p, q, r = x[3], x[4], x[5]
    inertia = parameters[0].inertia_kg_m2
    ix, iy, iz = inertia[0], inertia[1], inertia[2]
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
