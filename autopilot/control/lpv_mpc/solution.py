"""From the QP to the next plan, as compiled kernels; symbols are those of `planning`."""

from math import nan, sqrt

import numpy as np

from colibri.autopilot.control.lpv_mpc.constraints import MOTION_ROWS, exceeds, limit_motion
from colibri.autopilot.control.lpv_mpc.cost import nearest_angle
from colibri.autopilot.control.lpv_mpc.deviations import DEVIATIONS, RATE, ROTATION, VECTOR
from colibri.autopilot.control.lpv_mpc.planning import PREDICTED, QpKind, correct
from colibri.autopilot.control.qp import Qp
from colibri.common.compiled_rotations import euler_from_quaternion
from colibri.common.jit import Packed, compiled, inlined
from colibri.common.matrices import put
from colibri.common.types import Array

_BINDING = 1e-9  # an active limit has this or less left


@compiled
def free_minimum(qp: Qp, blocks: int, rotors: int, z: Array) -> bool:
    """Write the unconstrained minimum by Cholesky factors; return whether it is within bounds.

    Speeds along the path stay at their upper bounds, optimal while the vehicle is on time.
    """
    n, inputs = qp.f.shape[0], qp.f.shape[0] // blocks
    first_speed = rotors if inputs > rotors else n
    U, left = qp.H.copy(), np.empty(n)  # the factor L, transposed; its loops run along rows, to be vectorised
    for i in range(n):
        left[i] = -qp.f[i]
        for k in range(first_speed, n, inputs):
            left[i] -= qp.H[i, k] * qp.upper[k]
        z[i] = left[i]
    for k in range(first_speed, n, inputs):
        U[k, :] = 0.0
        U[:, k] = 0.0
        U[k, k], z[k] = 1.0, qp.upper[k]
    for j in range(n):
        first, fours = j // VECTOR * VECTOR, j // 4 * 4
        for k in range(0, fours, 4):  # four rows in a loop, as in `cost`
            a, b, c, d = U[k, j], U[k + 1, j], U[k + 2, j], U[k + 3, j]
            for i in range(first, n):
                U[j, i] = U[j, i] - U[k, i] * a - U[k + 1, i] * b - U[k + 2, i] * c - U[k + 3, i] * d
        for k in range(fours, j):
            factor = U[k, j]
            for i in range(first, n):
                U[j, i] -= U[k, i] * factor
        if not U[j, j] > 0.0:
            return False
        U[j, j] = sqrt(U[j, j])
        for k in range(j):
            z[j] -= U[k, j] * z[k]
        z[j] /= U[j, j]
        for i in range(j + 1, n):
            U[j, i] /= U[j, j]
    for i in range(n - 1, -1, -1):
        total = z[i]
        for k in range(i + 1, n):
            total -= U[i, k] * z[k]
        z[i] = total / U[i, i]
    for i in range(n):
        if not qp.lower[i] <= z[i] <= qp.upper[i]:
            return False
    for i in range(first_speed, n, inputs):
        slope = -left[i]
        for k in range(n):
            if k % inputs != rotors:
                slope += qp.H[i, k] * z[k]
        if slope > 0.0:
            return False
    return True


@compiled
def is_beyond(kind: Packed, z: Array) -> bool:
    work = kind[0].work
    return exceeds(work.motion, work.responses, z, kind[0].problem)


@compiled
def plan(
    kind: Packed, z: Array, solved: bool, psi: float, motion_steps: int, commands: Array, states: Array
) -> tuple[bool, bool, int]:
    """Write commands and states of the plan by a solution z, from yaw `psi`; motion only of the first steps.

    Unless `solved`, z becomes the unconstrained minimum; without one within all limits, there is no plan. Return
    whether z is within the rotor limits, whether beyond a soft limit, and the plan's active bounds.
    """
    if not solved:
        problem = kind[0].problem
        if not free_minimum(kind[0].qp, problem.starts.shape[0] - 1, len(problem.allocation), z):
            return False, False, 0
        if exceeds(kind[0].work.motion, kind[0].work.responses, z, problem):
            return True, True, 0
    return True, False, _read(kind[0], z, psi, motion_steps, commands, states)


@inlined
def _read(kind: QpKind, z: Array, psi: float, motion_steps: int, commands: Array, states: Array) -> int:
    """Write the plan by z; return its active bounds."""
    starts, work, qp = kind.problem.starts, kind.work, kind.qp
    corrections = work.corrections[1:].copy()
    inputs = z.shape[0] // corrections.shape[0]
    binding = 0
    for block in range(corrections.shape[0]):
        for rotor in range(corrections.shape[1]):
            k = inputs * block + rotor
            corrections[block, rotor] += z[k]
            if z[k] <= qp.lower[k] + _BINDING or z[k] >= qp.upper[k] - _BINDING:
                binding += 1
    correct(work.commands, corrections, starts, commands)
    _read_motion(work.motion, work.responses, z, psi, motion_steps, work.levels, states)
    _read_speeds(work.speeds, z, work.levels, states)
    return binding


@inlined
def _read_motion(
    motion: Array, responses: Array, z: Array, psi: float, motion_steps: int, levels: Array, states: Array
) -> None:
    """Write the motion of the first states by z, yaw unwrapped from `psi` on; that of the others is nan."""
    inputs, change = responses.shape[2] // levels.shape[0], np.empty(DEVIATIONS)
    rotors = states.shape[1] - PREDICTED
    states[motion_steps:, :PREDICTED] = nan
    for step in range(motion_steps):
        x, X, state, blocks = motion[step], responses[step], states[step], _begun(levels, step)
        for part in range(0, DEVIATIONS, 4):
            a, b, c, d = 0.0, 0.0, 0.0, 0.0
            for block in range(blocks):
                for k in range(inputs * block, inputs * block + rotors):  # four sums: none waits for another
                    a += X[part, k] * z[k]
                    b += X[part + 1, k] * z[k]
                    c += X[part + 2, k] * z[k]
                    d += X[part + 3, k] * z[k]
            change[part], change[part + 1], change[part + 2], change[part + 3] = a, b, c, d
        for i in range(6):
            state[i] = x[i] + change[i]
        a, b, c = 0.5 * change[ROTATION], 0.5 * change[ROTATION + 1], 0.5 * change[ROTATION + 2]
        length = sqrt(1.0 + a * a + b * b + c * c)
        w, x_, y, z_ = x[6] / length, x[7] / length, x[8] / length, x[9] / length
        turned = (
            w - a * x_ - b * y - c * z_,
            x_ + a * w + c * y - b * z_,
            y + b * w + a * z_ - c * x_,
            z_ + c * w + b * x_ - a * y,
        )
        phi, theta, yaw = euler_from_quaternion(turned)
        psi += nearest_angle(yaw - psi)
        state[6], state[7], state[8] = phi, theta, psi
        for i in range(3):
            state[9 + i] = x[10 + i] + change[RATE + i]


@inlined
def _read_speeds(speeds: Array, z: Array, levels: Array, states: Array) -> None:
    """Write the squared rotor speeds after the `PREDICTED` states by z."""
    inputs = z.shape[0] // levels.shape[0]
    for step in range(speeds.shape[0]):
        state, blocks = states[step], _begun(levels, step)
        for rotor in range(speeds.shape[1]):
            state[PREDICTED + rotor] = speeds[step, rotor]
            for block in range(blocks):
                state[PREDICTED + rotor] += levels[block, step] * z[inputs * block + rotor]


@inlined
def _begun(levels: Array, step: int) -> int:
    """Return how many blocks have begun before the end of a step."""
    blocks = len(levels)
    while blocks > 0 and levels[blocks - 1, step] == 0.0:
        blocks -= 1
    return blocks


@compiled
def limit(kind: Packed) -> None:
    work, free, qp = kind[0].work, kind[0].qp, kind[0].limited
    moved = free.f.shape[0]
    for k in range(moved):
        put(free.H[k], qp.H[k, :moved])
        qp.f[k], qp.lower[k], qp.upper[k] = free.f[k], free.lower[k], free.upper[k]
    limit_motion(work.motion, work.responses, kind[0].problem, qp.G, qp.h)


@compiled
def count_active(kind: Packed, z: Array) -> tuple[int, int]:
    qp, tilts, rates = kind[0].limited, 0, 0
    for row in range(qp.h.shape[0]):
        left = qp.h[row]
        for k in range(z.shape[0]):
            left -= qp.G[row, k] * z[k]
        if left <= _BINDING:
            if row % MOTION_ROWS == 0:
                tilts += 1
            else:
                rates += 1
    return tilts, rates
