"""The constraints of the QP, as compiled kernels: rotor limits as bounds, tilt and rates as soft rows.

Symbols and shapes are those of `cost`.
"""

import numpy as np

from colibri.autopilot.control.lpv_mpc.cost import Integers, Problem
from colibri.autopilot.control.lpv_mpc.deviations import RATE, ROTATION
from colibri.common.compiled_rotations import rotation_matrix
from colibri.common.jit import compiled, inlined
from colibri.common.types import Array

SLACKS = 2
TILT_SLACK, RATE_SLACK = 0, 1
MOTION_ROWS = 7  # of each checked step: tilt, and both sides of p, q and r


@inlined
def bound(commands: Array, limits: Array, corrections: Array, starts: Integers, lower: Array, upper: Array) -> None:
    """Fill the bounds of the commands' limits, and clip the nominal corrections to them.

    `commands` of the references, (N, m); `limits` (N, 2); `corrections` of each block, (b, m).
    """
    inputs = lower.shape[0] // corrections.shape[0]
    for block in range(corrections.shape[0]):
        for rotor in range(commands.shape[1]):
            least, most = -np.inf, np.inf
            for step in range(starts[block], starts[block + 1]):
                least = max(least, limits[step, 0] - commands[step, rotor])
                most = min(most, limits[step, 1] - commands[step, rotor])
            corrections[block, rotor] = min(max(corrections[block, rotor], least), most)
            lower[inputs * block + rotor] = least - corrections[block, rotor]
            upper[inputs * block + rotor] = most - corrections[block, rotor]


@compiled
def exceeds(motion: Array, responses: Array, z: Array, problem: Problem) -> bool:
    rates, turned = np.empty(3), np.empty(2)
    for step in problem.checked:
        x, X = motion[step], responses[step]
        R = rotation_matrix((x[6], x[7], x[8], x[9]))
        for i in range(3):
            rates[i] = x[10 + i]
            for k in range(z.shape[0]):
                rates[i] += X[RATE + i, k] * z[k]
            if abs(rates[i]) > problem.max_rate[i]:
                return True
        turned[:] = 0.0
        for i in range(2):
            for k in range(z.shape[0]):
                turned[i] += X[ROTATION + i, k] * z[k]
        if R[2][2] + R[2][0] * turned[1] - R[2][1] * turned[0] < problem.min_cos_tilt:
            return True
    return False


@compiled
def limit_motion(motion: Array, responses: Array, problem: Problem, G: Array, h: Array) -> None:
    """Fill the soft rows of tilt and rates, each in parts of its limit."""
    moved = responses.shape[2]
    count = 0
    G[:, :] = 0.0
    for step in problem.checked:
        x, X = motion[step], responses[step]
        R = rotation_matrix((x[6], x[7], x[8], x[9]))
        for k in range(moved):
            G[count, k] = R[2][1] * X[ROTATION, k] - R[2][0] * X[ROTATION + 1, k]
        G[count, moved + TILT_SLACK] = -1.0
        h[count] = R[2][2] - problem.min_cos_tilt
        for i in range(3):
            limit = problem.max_rate[i]
            for side in range(2):
                sign, at = 1.0 - 2.0 * side, count + 1 + 2 * i + side
                for k in range(moved):
                    G[at, k] = sign * X[RATE + i, k] / limit
                G[at, moved + RATE_SLACK] = -1.0
                h[at] = 1.0 - sign * x[10 + i] / limit
        count += MOTION_ROWS
