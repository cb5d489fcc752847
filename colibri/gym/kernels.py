"""One control interval of many vehicles, compiled."""

from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colibri.autopilot.control.parts.policy_interface import aim, observe, take, turn
from colibri.common.compiled_rotations import rotation_matrix
from colibri.common.jit import Packed, compiled, without_gil
from colibri.common.matrices import put
from colibri.common.types import Array, Vector
from colibri.plant.physics.equations import close_attitude
from colibri.plant.physics.integrators import runge_kutta_4

FAR, GROUND, NOT_FINITE, BAD_ACTION, DISARMED, MISSED, FINISHED = 1, 2, 3, 4, 5, 6, 7
LOST, PASSED = -10.0, 10.0  # rewards of a lost vehicle, and of a gate


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

    `gates` are centre and direction, ENU, and distance from the gate before, m, (m, 7); the last has length 0.
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


@without_gil
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
        scales: Idle and top speed, largest thrust (N), largest p, q, r (rad/s), moments of inertia, (n, 9).
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
                aim(x[n], action, mixers[n], scales[n], target)
                runge_kutta_4(x[n], target, numbers, duration_s / substeps, 1, end)
                put(end, x[n])
        else:
            turn(action, scales[n], target)
            runge_kutta_4(x[n], target, numbers, duration_s, substeps, end)
            put(end, x[n])
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
