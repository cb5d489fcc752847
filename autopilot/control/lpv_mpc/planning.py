"""From the previous plan to the QP, and from its solution to the next plan, as compiled kernels.

Commands and corrections are squared rotor speeds in parts of the largest; m is the number of rotors.
"""

from math import inf, nan, radians, sqrt
from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.lpv_mpc.constraints import MOTION_ROWS, bound, exceeds, limit_motion
from colibri.autopilot.control.lpv_mpc.cost import Integers, PlanReferences, Problem, cost, nearest_angle
from colibri.autopilot.control.lpv_mpc.deviations import DEVIATIONS, RATE, ROTATION, VECTOR, StepTransition, respond
from colibri.autopilot.control.lpv_mpc.feed_forward import follow, lead
from colibri.autopilot.control.lpv_mpc.model import Disturbance, Drive, roll_out
from colibri.autopilot.control.lpv_mpc.path import PathNow, SpeedEffects, fill_slides, price
from colibri.autopilot.control.parts.thrust_force import ForceLimits
from colibri.autopilot.control.qp import Qp
from colibri.autopilot.control.vehicle_model.battery import common_speed, drawn_ah, fill_limits, open_voltage, terminal
from colibri.autopilot.control.vehicle_model.disturbance_observer import ESTIMATES, limit_near_ground, observe
from colibri.autopilot.control.vehicle_model.drag import with_learned
from colibri.autopilot.control.vehicle_model.mass import follow_mass
from colibri.common.compiled_rotations import euler_from_quaternion, rotation_matrix
from colibri.common.elementary import cos
from colibri.common.jit import Packed, compiled, inlined
from colibri.common.matrices import dot, put
from colibri.common.types import Array, Quaternion, Vector

PREDICTED = 12  # position and velocity, ENU; phi, theta, psi; p, q, r; then m squared rotor speeds
_BINDING = 1e-9  # an active limit has this or less left
RECOVER_BEYOND = cos(radians(75.0))  # recovery from a larger error of the thrust axis
_LIMITED_STEPS, _SHARES, _ALWAYS = 3, 3.0, 0.5
"""In the first steps each rotor is limited to `_SHARES` times its share of the required thrust, but at least `_ALWAYS`
times its hover thrust: at low thrust, moments against a supposed disturbance would tip over a standing vehicle."""


class Now(NamedTuple):
    """Start of a plan."""

    rigid: Array  # state, see `model.RIGID`, (13,)
    squared: Array  # rotor speeds, (m,)
    disturbance: Disturbance
    limits: Array  # least and largest squared speed of each step, (N, 2)
    force: ForceLimits  # demanded by references
    span_n: float  # thrust of all rotors at their largest speed
    hover_squared: float


class Workspace(NamedTuple):
    """Arrays filled by every plan, except the last two."""

    commands: Array  # of the references, within the limits, (N, m)
    corrections: Array  # nominal: the last one flown, then of each block, (b + 1, m)
    motion: Array  # nominal, (N + 1, 13)
    speeds: Array  # nominal, squared, (N + 1, m)
    drive: Drive
    transition: StepTransition
    responses: Array  # (N + 1, 12, m b)
    means: Array  # of `deviations.respond`, (b, N)
    levels: Array  # of `deviations.respond`, (b, N + 1)


class QpKind(NamedTuple):
    problem: Problem
    work: Workspace
    qp: Qp  # within rotor limits
    limited: Qp  # with soft limits, too


@compiled
def begin(
    position: Vector, velocity: Vector, attitude: Quaternion, rate: Vector, rotors: Array, before: Array,
    estimate_before: Array, mass_kg: float, charge_ah: float, airborne: bool, states: Array, age: int, tracker: Packed,
    battery: Packed, now: Packed, vehicle: Packed, measured: Array, estimate: Array,
) -> tuple[float, float, float]:  # fmt: skip
    """Observe the vehicle, and fill the start of a plan; return charge a sample later, mass, and largest speed.

    Arguments are those of `VehicleState` and `Tracked`; `before`, and the `states` of the previous plan, are empty at
    first. The power of its speeds, or without them that of the present ones, limits the speeds. Filled are `measured`
    and `estimate`, `now` except constants, and the `vehicle`'s airframe.
    """
    start, model = now[0], tracker[0]
    speeds, wrench, mean_wrench = rotors[1, : start.squared.shape[0]], rotors[2], rotors[3]
    rigid, R = start.rigid, rotation_matrix(attitude)
    for i in range(3):
        rigid[i], rigid[3 + i], rigid[10 + i] = position[i], velocity[i], rate[i]
        measured[i], measured[3 + i], measured[6 + i] = velocity[i], rate[i], R[i][2]
    for i in range(4):
        rigid[6 + i] = attitude[i]
    if before.shape[0] > 0:
        h = dot(model.momentum, speeds)
        put(observe(estimate_before, before, measured, mean_wrench, h, mass_kg, model.observer), estimate)
    else:
        put(estimate_before, estimate)
        put(measured, estimate[:6])
        estimate[6:ESTIMATES] = 0.0
    if airborne:
        mass_kg = follow_mass(mass_kg, estimate[6:], measured[6:], wrench[0], model.mass)
    else:
        limit_near_ground(estimate, estimate_before, model.observer)
    airframe = vehicle[0].airframe
    airframe.mass_kg = mass_kg
    if estimate.shape[0] > ESTIMATES:
        learned = with_learned(model.observer.airframe, mass_kg, estimate[ESTIMATES:])
        airframe.drag_xy, airframe.drag_z, airframe.rotor_drag = learned.drag_xy, learned.drag_z, learned.rotor_drag
    for i in range(3):
        start.disturbance.acceleration[i], start.disturbance.moment[i] = estimate[6 + i], estimate[9 + i]
    for i in range(speeds.shape[0]):
        start.squared[i] = speeds[i] * speeds[i]
    open_v, speed = open_voltage(battery[0], charge_ah), common_speed(charge_ah, battery)
    if states.shape[0] > 0:
        fill_limits(states[age:, PREDICTED:], open_v, battery, start.limits[:, 1])
    else:
        fill_limits(start.squared.copy().reshape((1, -1)), open_v, battery, start.limits[:, 1])
    start.force.max_n = start.span_n * (speed * speed)
    voltage_v, current_a = terminal(open_v, speeds, battery)
    charge_ah = drawn_ah(charge_ah, current_a, model.observer.interval_s)
    return charge_ah, mass_kg, voltage_v / battery[0].full_voltage_v


@compiled
def begin_by_clock(
    position_ahead: Array, velocity_ahead: Array, acceleration_ahead: Array, yaw_ahead: Array, law: Packed,
    target: Packed, kind: Packed, commands: Array, position: Vector, velocity: Vector, attitude: Quaternion,
    rate: Vector, rotors: Array, before: Array, estimate_before: Array, mass_kg: float, charge_ah: float,
    airborne: bool, states: Array, age: int, tracker: Packed, battery: Packed, now: Packed, vehicle: Packed,
    measured: Array, estimate: Array,
) -> tuple[tuple[float, float, float], tuple[float, float, float, float, float]]:  # fmt: skip
    """Run `begin`, `follow` and, unless recovery may be needed, `condense`; return the results of the first two."""
    begun = begin(
        position, velocity, attitude, rate, rotors, before, estimate_before, mass_kg, charge_ah, airborne, states, age,
        tracker, battery, now, vehicle, measured, estimate,
    )  # fmt: skip
    aim = follow(now, position_ahead, velocity_ahead, acceleration_ahead, yaw_ahead, law, vehicle, target)
    if not aim[0] < RECOVER_BEYOND * aim[1]:
        condense(now, target, commands[age:], aim[0], airborne, vehicle, kind)
    return begun, aim


@compiled
def condense(
    now: Packed, target: Packed, last: Array, along_n: float, airborne: bool, vehicle: Packed, kind: Packed
) -> None:
    """Fill the QP within the rotor limits.

    `last`: the previous plan's commands from now on, (n, m); `along_n`: required thrust along the present body z.
    """
    work = kind[0].work
    _expect(now[0], target[0], last, along_n, airborne, vehicle, kind[0])
    cost(work.motion, work.speeds, work.responses, target[0], work.corrections, kind[0].problem, kind[0].qp)


@compiled
def condense_on_path(
    now: Packed, target: Packed, last: Array, along_n: float, airborne: bool, path: PathNow, effects: SpeedEffects,
    vehicle: Packed, kind: Packed,
) -> None:  # fmt: skip
    """Fill the QP with free speed along the path."""
    work = kind[0].work
    _expect(now[0], target[0], last, along_n, airborne, vehicle, kind[0])
    fill_slides(path, effects, work.responses)
    cost(work.motion, work.speeds, work.responses, target[0], work.corrections, kind[0].problem, kind[0].qp)
    price(path, effects, kind[0].problem.starts, kind[0].qp)


@inlined
def _expect(
    now: Now, target: PlanReferences, last: Array, along_n: float, airborne: bool, vehicle: Packed, kind: QpKind
) -> None:
    starts, work, qp = kind.problem.starts, kind.work, kind.qp
    commands, corrections, most = work.commands, work.corrections, inf
    if now.force.upright or not airborne:
        most = max(_SHARES * along_n / now.span_n, _ALWAYS * now.hover_squared)
    for step in range(min(_LIMITED_STEPS, commands.shape[0])):
        now.limits[step, 1] = min(now.limits[step, 1], most)
    lead(target.squared, vehicle[0].lag.left, now.limits, commands)
    corrections[:] = 0.0
    ease(commands, starts, now.limits)
    if last.shape[0] > 0:
        carry_over(last, commands, starts, corrections)
    bound(commands, now.limits, corrections[1:], starts, qp.lower, qp.upper)
    nominal = np.empty_like(commands)
    _correct(commands, corrections[1:], starts, nominal)
    roll_out(now.rigid, now.squared, nominal, now.disturbance, vehicle, work.drive, work.motion, work.speeds)
    respond(work.motion, work.speeds, work.means, work.levels, vehicle, work.transition, work.responses)


@inlined
def ease(commands: Array, starts: Integers, limits: Array) -> None:
    """Limit the references' commands in each block to half of the rotors' range.

    Commands at both ends of the range would leave no room for the block's one correction.
    """
    for block in range(starts.shape[0] - 1):
        begin, end = starts[block], starts[block + 1]
        for rotor in range(commands.shape[1]):
            low, high, least, most = np.inf, -np.inf, -np.inf, np.inf
            for step in range(begin, end):
                low, high = min(low, commands[step, rotor]), max(high, commands[step, rotor])
                least, most = max(least, limits[step, 0]), min(most, limits[step, 1])
            if high - low > 0.5 * (most - least):
                part = 0.5 * (most - least) / (high - low)
                to = min(max(0.5 * (low + high), 0.75 * least + 0.25 * most), 0.25 * least + 0.75 * most)
                for step in range(begin, end):
                    commands[step, rotor] = to + part * (commands[step, rotor] - 0.5 * (low + high))


@inlined
def carry_over(last: Array, commands: Array, starts: Integers, corrections: Array) -> None:
    """Fill the correction of each block, and before them the first again, (b + 1, m).

    Each is the block's mean of the previous plan's commands, the last one repeated, minus `commands`.
    """
    for block in range(starts.shape[0] - 1):
        corrections[block + 1] = 0.0
        steps = starts[block + 1] - starts[block]
        for step in range(starts[block], starts[block + 1]):
            for rotor in range(commands.shape[1]):
                planned = last[min(step, last.shape[0] - 1), rotor]
                corrections[block + 1, rotor] += (planned - commands[step, rotor]) / steps
    put(corrections[1], corrections[0])


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
    kind: Packed, z: Array, solved: bool, psi: float, moments: int, commands: Array, states: Array
) -> tuple[bool, bool, int]:
    """Write commands and states of the plan by a solution z, from yaw `psi`; the motion of the first `moments` alone.

    Unless `solved`, z becomes the unconstrained minimum; without one within all limits, there is no plan. Return
    whether z is within the rotor limits, whether beyond a soft limit, and the plan's active bounds.
    """
    if not solved:
        problem = kind[0].problem
        if not free_minimum(kind[0].qp, problem.starts.shape[0] - 1, len(problem.allocation), z):
            return False, False, 0
        if exceeds(kind[0].work.motion, kind[0].work.responses, z, problem):
            return True, True, 0
    return True, False, _read(kind[0], z, psi, moments, commands, states)


@inlined
def _read(kind: QpKind, z: Array, psi: float, moments: int, commands: Array, states: Array) -> int:
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
    _correct(work.commands, corrections, starts, commands)
    _read_motion(work.motion, work.responses, z, psi, moments, work.levels, states)
    _read_speeds(work.speeds, z, work.levels, states)
    return binding


@inlined
def _read_motion(
    motion: Array, responses: Array, z: Array, psi: float, moments: int, levels: Array, states: Array
) -> None:
    """Write the motion of the first `moments` states by z, yaw unwrapped from `psi` on; that of the others is nan."""
    inputs, change = responses.shape[2] // levels.shape[0], np.empty(DEVIATIONS)
    rotors = states.shape[1] - PREDICTED
    states[moments:, :PREDICTED] = nan
    for step in range(moments):
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


@inlined
def _correct(commands: Array, corrections: Array, starts: Integers, out: Array) -> None:
    for block in range(corrections.shape[0]):
        for step in range(starts[block], starts[block + 1]):
            for rotor in range(commands.shape[1]):
                out[step, rotor] = commands[step, rotor] + corrections[block, rotor]


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
