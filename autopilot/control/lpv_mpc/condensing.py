"""The QP of the attitude MPC, condensed to the increments and two slacks, as compiled kernels.

    z = [Δu at each move, angle slack, rate slack]
    min ½ zᵀHz + fᵀz   subject to   G z <= h,   lower <= z <= upper

The cost is [3.13-3.20] with a full terminal weight on state and input. Arguments: `prediction.respond`'s responses and
schedule, the moments u last commanded, N m, (3,), and U1 at each step, N, (N,).
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.lpv_mpc.prediction import ANGLES, INPUTS, STATES, Integers, P, Q, R
from colibri.autopilot.control.qp import Qp
from colibri.common.jit import Packed, compiled
from colibri.common.kernels import atan2, cos, sin
from colibri.common.matrices import matmul
from colibri.common.types import Array

SLACKS = 2
ANGLE_SLACK, RATE_SLACK = 0, 1
ROTORS = 4
LIMITED = 5  # phi and theta share a slack with the tilt; p, q and r share the other
_TWO_SIDES = 2
MOTION_ROWS = 1 + _TWO_SIDES * LIMITED  # of each checked step: tilt, then both sides of phi, theta, p, q and r
_ANGLE_ROWS = 1 + _TWO_SIDES * 2
_NO_TILT = 1e-9


class Problem(NamedTuple):
    """Constants of all QPs."""

    starts: Integers  # step of each move, (b,)
    checked: Integers  # steps with soft limits, (c,)
    output_weight: Array  # diagonal of Q, (3,)
    increment_weight: Array  # diagonal of R, (3,)
    terminal_weight: Array  # S on state and input, (12, 12), symmetric
    max_increment: Array  # of the first move, N m, (3,)
    limits: Array  # of tilt and |phi|, |theta|, |p|, |q|, |r|, rad and rad/s, (5,)
    from_thrust: Array  # U1 to squared rotor speeds, (4,)
    from_moments: Array  # U2, U3, U4 to squared rotor speeds, (4, 3)
    min_squared: float


class Target(NamedTuple):
    """The references of a plan."""

    angles: Array  # phi, theta, psi after each step, rad, (N, 3)
    end: Array  # state and moments at the end of the horizon, (12,)
    thrust_n: Array  # U1 commanded at each step, N, (N,)


@compiled
def quadratic_cost(responses: Array, target: Target, u: Array, problem: Problem, H: Array, f: Array) -> None:
    steps = responses.shape[0] - 1
    moved = responses.shape[2] - 1
    H[:moved, :moved] = 0.0
    f[:moved] = 0.0
    for step in range(1, steps + 1):
        for j in range(INPUTS):
            row = responses[step, ANGLES[j]]
            weight = problem.output_weight[j]
            error = weight * (row[0] - target.angles[step - 1, j])
            for k in range(moved):
                f[k] += error * row[1 + k]
                weighted = weight * row[1 + k]
                for i in range(k + 1):
                    H[k, i] += weighted * row[1 + i]
    _add_terminal(responses[steps], target.end, u, problem.terminal_weight, H, f)
    for k in range(moved):
        H[k, k] += problem.increment_weight[k % INPUTS]
        for i in range(k):
            H[i, k] = H[k, i]


@compiled
def _add_terminal(last: Array, terminal: Array, u: Array, S: Array, H: Array, f: Array) -> None:
    """Add ½ eᵀSe of the final error to the lower triangle of H."""
    moved = last.shape[1] - 1
    E = np.zeros((STATES + INPUTS, moved + 1))
    E[:STATES] = last
    for i in range(INPUTS):
        E[STATES + i, 0] = u[i]
        for k in range(i, moved, INPUTS):
            E[STATES + i, 1 + k] = 1.0
    E[:, 0] -= terminal
    weighted = matmul(S, E)
    for k in range(moved):
        for row in range(STATES + INPUTS):
            f[k] += E[row, 1 + k] * weighted[row, 0]
        for i in range(k + 1):
            for row in range(STATES + INPUTS):
                H[k, i] += E[row, 1 + k] * weighted[row, 1 + i]


@compiled
def limit_rotors(problem: Problem, thrust_n: Array, u: Array, max_squared: float, G: Array, h: Array) -> int:
    """Fill the rows of the rotor limits from row 0 on; return their number.

    Moments are constant between two moves: one row a side, at the tightest thrust, suffices.
    """
    starts, from_thrust, from_moments = problem.starts, problem.from_thrust, problem.from_moments
    count = 0
    for move in range(starts.shape[0]):
        end = starts[move + 1] if move + 1 < starts.shape[0] else thrust_n.shape[0]
        minimum, maximum = thrust_n[starts[move]], thrust_n[starts[move]]
        for step in range(starts[move], end):
            minimum, maximum = min(minimum, thrust_n[step]), max(maximum, thrust_n[step])
        for rotor in range(ROTORS):
            turned = 0.0
            for i in range(INPUTS):
                turned += from_moments[rotor, i] * u[i]
                for j in range(move + 1):
                    G[count, INPUTS * j + i] = from_moments[rotor, i]
                    G[count + 1, INPUTS * j + i] = -from_moments[rotor, i]
            h[count] = max_squared - from_thrust[rotor] * maximum - turned
            h[count + 1] = turned + from_thrust[rotor] * minimum - problem.min_squared
            count += _TWO_SIDES
    return count


@compiled
def tilt_tangent(phi: float, theta: float, max_tilt: float, normal: Array) -> float:
    """Write the normal, (2,), of a tangent to the tilt limit; return its distance, rad.

    The convex set cos(phi) cos(theta) >= cos(max_tilt) touches it in the direction of (`phi`, `theta`); without tilt
    the normal is zero.
    """
    x, y = sin(theta) * cos(phi), sin(phi)
    across = sqrt(x * x + y * y)
    normal[:] = 0.0
    if across < _NO_TILT:
        return 1.0
    x, y, z = x / across * sin(max_tilt), y / across * sin(max_tilt), cos(max_tilt)
    xz = sqrt(x * x + z * z)
    normal[0], normal[1] = y / xz, x / z
    distance: float = normal[0] * atan2(y, xz) + normal[1] * atan2(x, z)
    return distance


@compiled
def limit_motion(responses: Array, schedule: Array, problem: Problem, first: int, G: Array, h: Array) -> int:
    """Fill the soft rows of angles, rates and tilt, by its tangent, from row `first` on."""
    states = (ANGLES[0], ANGLES[1], P, Q, R)
    limits = problem.limits
    moved = responses.shape[2] - 1
    normal = np.empty(2)
    count = first
    for step in problem.checked:
        phi, theta = responses[step, ANGLES[0]], responses[step, ANGLES[1]]
        distance = tilt_tangent(schedule[step - 1, 0], schedule[step - 1, 1], limits[0], normal)
        for k in range(moved):
            G[count, k] = (normal[0] * phi[1 + k] + normal[1] * theta[1 + k]) / distance
        G[count, moved + ANGLE_SLACK] = -1.0
        h[count] = 1.0 - (normal[0] * phi[0] + normal[1] * theta[0]) / distance
        count += 1
        for i in range(LIMITED):
            row = responses[step, states[i]]
            slack = moved + (ANGLE_SLACK if i < 2 else RATE_SLACK)
            for k in range(moved):
                G[count, k] = row[1 + k] / limits[i]
                G[count + 1, k] = -row[1 + k] / limits[i]
            G[count, slack] = -1.0
            G[count + 1, slack] = -1.0
            h[count] = 1.0 - row[0] / limits[i]
            h[count + 1] = 1.0 + row[0] / limits[i]
            count += _TWO_SIDES
    return count


@compiled
def read_plan(responses: Array, packed: Packed, u: Array, z: Array, thrust_n: Array) -> tuple[Array, Array, Array]:
    problem = packed[0]
    starts, from_thrust, from_moments = problem.starts, problem.from_thrust, problem.from_moments
    steps = responses.shape[0] - 1
    moved = responses.shape[2] - 1
    states, moments, squared = np.empty((steps + 1, STATES)), np.empty((steps, INPUTS)), np.empty((steps, ROTORS))
    for step in range(steps + 1):
        for state in range(STATES):
            total = responses[step, state, 0]
            for k in range(moved):
                total += responses[step, state, 1 + k] * z[k]
            states[step, state] = total
    held = u.copy()
    move = 0
    for step in range(steps):
        if move < starts.shape[0] and starts[move] == step:
            held += z[INPUTS * move : INPUTS * move + INPUTS]
            move += 1
        moments[step] = held
        for rotor in range(ROTORS):
            total = from_thrust[rotor] * thrust_n[step]
            for i in range(INPUTS):
                total += from_moments[rotor, i] * held[i]
            squared[step, rotor] = total
    return states, moments, squared


@compiled
def count_active(
    G: Array, h: Array, lower: Array, upper: Array, z: Array, rotor_rows: int, binding: float
) -> tuple[int, int, int, int]:
    """Return the numbers of active limits of rotors, increments, angles and rates at z."""
    increments = 0
    for k in range(z.shape[0] - SLACKS):
        if z[k] - lower[k] < binding or upper[k] - z[k] < binding:
            increments += 1
    rotors, angles, rates = 0, 0, 0
    for row in range(G.shape[0]):
        left = h[row]
        for k in range(z.shape[0]):
            left -= G[row, k] * z[k]
        if left < binding:
            if row < rotor_rows:
                rotors += 1
            elif (row - rotor_rows) % MOTION_ROWS < _ANGLE_ROWS:
                angles += 1
            else:
                rates += 1
    return rotors, increments, angles, rates


@compiled
def condense(
    responses: Array, schedule: Array, target: Target, u: Array, packed: Packed, max_squared: float, qp: Qp
) -> None:
    problem = packed[0]
    for i in range(INPUTS):  # the first increments may always cancel u
        qp.lower[i] = min(-problem.max_increment[i], -u[i])
        qp.upper[i] = max(problem.max_increment[i], -u[i])
    quadratic_cost(responses, target, u, problem, qp.H, qp.f)
    row = limit_rotors(problem, target.thrust_n, u, max_squared, qp.G, qp.h)
    limit_motion(responses, schedule, problem, row, qp.G, qp.h)


@compiled
def objective(H: Array, f: Array, z: Array) -> float:
    total = 0.0
    for i in range(z.shape[0]):
        total += f[i] * z[i]
        for k in range(z.shape[0]):
            total += 0.5 * z[i] * H[i, k] * z[k]
    return total
