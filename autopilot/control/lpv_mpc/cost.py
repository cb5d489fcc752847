"""The cost of the QP, condensed to changes of the corrections, as compiled kernels.

    z = changes of the corrections: of each rotor in each block, then two slacks if limits are soft
    min ½ zᵀHz + fᵀz   subject to   G z <= h,   lower <= z <= upper

With b blocks and m rotors: nominal motion, (N + 1, 13), and squared speeds, (N + 1, m), responses, (N + 1, 12, m b).
"""

from math import floor, pi, sqrt
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from colibri.autopilot.control.lpv_mpc.deviations import DEVIATIONS, POSITION, RATE, ROTATION, VECTOR, VELOCITY
from colibri.autopilot.control.lpv_mpc.feed_forward import HEADING_ABOVE, rate_between
from colibri.autopilot.control.qp import Qp
from colibri.common.compiled_rotations import rotation_matrix
from colibri.common.jit import compiled, inlined, noalias
from colibri.common.kernels import atan2
from colibri.common.matrices import add_four, put
from colibri.common.types import Array

Integers: TypeAlias = NDArray[np.int64]


class CostWeights(NamedTuple):
    """Weights of errors and corrections."""

    position: float  # 1/m²
    velocity: float  # s²/m²
    tilt: float  # of a demanded attitude, 1/rad²
    heading: float  # 1/rad²
    rate: float  # s²/rad²
    thrust: float  # of a demanded thrust, 1/N²
    first: float  # change from the previous plan
    next: float  # change from block to block


class Problem(NamedTuple):
    """Constants of the QPs of one kind."""

    starts: Integers  # step of each block, and N, (b + 1,)
    counted: Integers  # steps with errors in the cost, (c,)
    checked: Integers  # steps with soft limits, (d,)
    weights: CostWeights
    terminal: Array  # S on the error at the end: position, velocity, rotation, rates, body axes; squared speeds; zeros
    allocation: Array  # thrust of each rotor at its largest speed, N, (m,)
    levels: Array  # squared speed at each step by a unit correction of each block, (b, N + 1)
    upright: bool  # False: attitude errors beyond 90° count whole, and yaw only where it has a meaning
    min_cos_tilt: float  # of the soft limit
    max_rate: Array  # of |p|, |q|, |r|, rad/s, (3,)


class PlanReferences(NamedTuple):
    """References from now to one sample past the horizon, n = N + 2."""

    position: Array  # m, ENU, (n, 3)
    velocity: Array  # m/s, ENU, (n, 3)
    acceleration: Array  # m/s², ENU, (n, 3)
    forces: Array  # of the thrust, N, ENU, (n, 3)
    attitudes: Array  # body to earth, (n, 3, 3)
    yaw_rad: Array  # in any turn, (n,)
    rates: Array  # rad/s, FLU, at samples 1 to N, (N, 3)
    squared: Array  # rotor speeds at samples 0 to N, (N + 1, m)
    thrusts_n: Array  # U1, (n,)
    end_squared: Array  # rotor speeds at the end, (m,)
    force: Array  # to align thrust with now, N, ENU, (3,)


@inlined
def cost(
    motion: Array,
    speeds: Array,
    responses: Array,
    target: PlanReferences,
    corrections: Array,  # the last one flown, then the nominal ones, (b + 1, m)
    problem: Problem,
    qp: Qp,
) -> None:
    moved = responses.shape[2]
    inputs = moved // (problem.starts.shape[0] - 1)
    H, f, row = qp.H, qp.f, np.empty(moved)
    H[:, :] = 0.0
    f[:] = 0.0
    for step in problem.counted:
        used = inputs * _blocks(problem.starts, step)
        _add_motion(motion, responses, step, target, problem, used, row, H, f)
        if problem.weights.tilt > 0.0 or problem.weights.thrust > 0.0:
            _add_demand(motion[step], speeds[step], responses[step], step, target, problem, used, row, H, f)
    _add_terminal(motion[-1], speeds[-1], responses[-1], target, problem, H, f)
    _add_changes(corrections, problem, inputs, H, f)
    for k in range(moved):
        for i in range(k):
            H[i, k] = H[k, i]


@compiled
def _blocks(starts: Integers, step: int) -> int:
    blocks = 0
    while blocks < starts.shape[0] - 1 and starts[blocks] < step:
        blocks += 1
    return blocks


@inlined
def _reach(k: int, columns: int) -> int:
    """Return how far row k of the symmetric H is computed: to its diagonal, in whole vectors of columns."""
    return min((k // VECTOR + 1) * VECTOR, columns)


@inlined
def _add_motion(
    motion: Array,
    responses: Array,
    n: int,
    target: PlanReferences,
    problem: Problem,
    used: int,
    row: Array,
    H: Array,
    f: Array,
) -> None:
    """Add ½ weight (error + row z)² of position, velocity, rates and heading at step n.

    One loop over the rows: loading an element of H takes as long as adding one row.
    """
    weights = problem.weights
    on_place, on_velocity, on_rate, on_heading = weights.position, weights.velocity, weights.rate, weights.heading
    x, X = motion[n], responses[n]
    p0, p1, p2 = x[0] - target.position[n, 0], x[1] - target.position[n, 1], x[2] - target.position[n, 2]
    v0, v1, v2 = x[3] - target.velocity[n, 0], x[4] - target.velocity[n, 1], x[5] - target.velocity[n, 2]
    w0, w1, w2 = x[10] - target.rates[n - 1, 0], x[11] - target.rates[n - 1, 1], x[12] - target.rates[n - 1, 2]
    R = rotation_matrix((x[6], x[7], x[8], x[9]))
    cos_pitch = max(sqrt(R[2][1] * R[2][1] + R[2][2] * R[2][2]), 1e-9)
    s, c = R[2][1] / cos_pitch, R[2][2] / cos_pitch
    heading = cos_pitch * nearest_angle(atan2(R[1][0], R[0][0]) - target.yaw_rad[n])
    if not problem.upright:
        on_heading *= min(max(R[2][2] / HEADING_ABOVE, 0.0), 1.0)  # beyond, yaw has no meaning
    for k in range(X.shape[1]):
        row[k] = s * X[ROTATION + 1, k] + c * X[ROTATION + 2, k]
    for k in range(used):
        P0, P1, P2 = on_place * X[POSITION, k], on_place * X[POSITION + 1, k], on_place * X[POSITION + 2, k]
        V0, V1, V2 = on_velocity * X[VELOCITY, k], on_velocity * X[VELOCITY + 1, k], on_velocity * X[VELOCITY + 2, k]
        W0, W1, W2 = on_rate * X[RATE, k], on_rate * X[RATE + 1, k], on_rate * X[RATE + 2, k]
        turned = on_heading * row[k]
        first = f[k] + p0 * P0 + v0 * V0 + w0 * W0
        second = first + p1 * P1 + v1 * V1 + w1 * W1
        f[k] = second + p2 * P2 + v2 * V2 + w2 * W2 + heading * turned
        factors = (P0, V0, W0, P1, V1, W1, P2, V2, W2, turned)
        _add_rows(H[k], X, row, factors, _reach(k, X.shape[1]))


@noalias
def _add_rows(to: Array, X: Array, row: Array, factors: tuple[float, ...], count: int) -> None:
    """Add rows of X, and another one, times factors to the first `count` numbers of a row of H."""
    P0, V0, W0, P1, V1, W1, P2, V2, W2, turned = factors
    for i in range(count):
        first = to[i] + P0 * X[POSITION, i] + V0 * X[VELOCITY, i] + W0 * X[RATE, i]
        second = first + P1 * X[POSITION + 1, i] + V1 * X[VELOCITY + 1, i] + W1 * X[RATE + 1, i]
        third = second + P2 * X[POSITION + 2, i] + V2 * X[VELOCITY + 2, i] + W2 * X[RATE + 2, i]
        to[i] = third + turned * row[i]


@compiled
def _add_demand(
    x: Array, squared: Array, X: Array, step: int, target: PlanReferences, problem: Problem, used: int, row: Array,
    H: Array, f: Array,
) -> None:  # fmt: skip
    weights = problem.weights
    away = _rotation_error(target.attitudes[step], rotation_matrix((x[6], x[7], x[8], x[9])), problem)
    for i in range(2):
        _add(weights.tilt, away[i], X[ROTATION + i], used, H, f)
    thrust = -target.thrusts_n[step]
    rotors = len(problem.allocation)
    for rotor in range(rotors):
        thrust += problem.allocation[rotor] * squared[rotor]
    for k in range(used):
        row[k] = problem.allocation[k % rotors] * problem.levels[k // rotors, step]
    _add(weights.thrust, thrust, row, used, H, f)


@compiled
def _add(weight: float, error: float, row: Array, used: int, H: Array, f: Array) -> None:
    for k in range(used):
        weighted = weight * row[k]
        f[k] += error * weighted
        for i in range(k + 1):
            H[k, i] += weighted * row[i]


@compiled
def nearest_angle(angle: float) -> float:
    return angle - 2.0 * pi * floor(angle / (2.0 * pi) + 0.5)


@compiled
def _rotation_error(wanted: Array, R: tuple[tuple[float, float, float], ...], problem: Problem) -> Array:
    error = np.empty(3)
    rate_between(wanted, np.array(R), 1.0, error)
    if problem.upright:
        return error
    c = -0.5
    for i in range(3):
        c += 0.5 * (wanted[0, i] * R[0][i] + wanted[1, i] * R[1][i] + wanted[2, i] * R[2][i])
    if c < 0.0:  # more than a quarter turn: the same axis, its whole angle
        length = sqrt(error[0] * error[0] + error[1] * error[1] + error[2] * error[2])
        angle = atan2(sqrt(max(1.0 - c * c, 0.0)), c)
        for i in range(3):
            error[i] *= angle / max(length, 1e-9)
    return error


@inlined
def _add_terminal(
    x: Array, squared: Array, X: Array, target: PlanReferences, problem: Problem, H: Array, f: Array
) -> None:
    """Add ½ eᵀ S e of the final error in body axes; four rows in a loop, as in `_add_motion`."""
    S, states = problem.terminal, problem.terminal.shape[0]
    steps, moved = target.rates.shape[0], X.shape[1]
    inputs = moved // problem.levels.shape[0]
    R = rotation_matrix((x[6], x[7], x[8], x[9]))
    away = _rotation_error(target.attitudes[steps], R, problem)
    error, E = np.zeros(states), np.zeros((states, moved))
    for i in range(3):
        for j in range(3):
            turned = R[j][i]
            error[i] += turned * (x[POSITION + j] - target.position[steps, j])
            error[VELOCITY + i] += turned * (x[VELOCITY + j] - target.velocity[steps, j])
            for k in range(moved):
                E[i, k] += turned * X[POSITION + j, k]
            for k in range(moved):
                E[VELOCITY + i, k] += turned * X[VELOCITY + j, k]
        error[ROTATION + i] = away[i]
        error[RATE + i] = x[10 + i] - target.rates[steps - 1, i]
        put(X[ROTATION + i], E[ROTATION + i])
        put(X[RATE + i], E[RATE + i])
    for rotor in range(len(problem.allocation)):
        error[DEVIATIONS + rotor] = squared[rotor] - target.end_squared[rotor]
        for block in range(problem.levels.shape[0]):
            E[DEVIATIONS + rotor, inputs * block + rotor] = problem.levels[block, steps]
    weighted, W = np.zeros(states), np.zeros((states, moved))
    for i in range(states):
        for j in range(states):
            weighted[i] += S[i, j] * error[j]
        for j in range(0, states, 4):
            add_four(W[i], E[j : j + 4], (S[i, j], S[i, j + 1], S[i, j + 2], S[i, j + 3]), 0, moved)
    for i in range(0, states, 4):
        for k in range(moved):
            s, t, u, v = E[i, k], E[i + 1, k], E[i + 2, k], E[i + 3, k]
            f[k] = f[k] + s * weighted[i] + t * weighted[i + 1] + u * weighted[i + 2] + v * weighted[i + 3]
            add_four(H[k], W[i : i + 4], (s, t, u, v), 0, _reach(k, moved))


@inlined
def _add_changes(corrections: Array, problem: Problem, inputs: int, H: Array, f: Array) -> None:
    for block in range(problem.starts.shape[0] - 1):
        weight = problem.weights.first if block == 0 else problem.weights.next
        for rotor in range(corrections.shape[1]):
            here = inputs * block + rotor
            change = weight * (corrections[block + 1, rotor] - corrections[block, rotor])
            H[here, here] += weight
            f[here] += change
            if block > 0:
                H[here - inputs, here - inputs] += weight
                H[here, here - inputs] -= weight
                f[here - inputs] -= change
