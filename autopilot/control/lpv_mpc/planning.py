"""From the previous plan to the QP, as compiled kernels; `solution` leads from there to the next plan.

Commands and corrections are squared rotor speeds in parts of the largest; m is the number of rotors.
"""

from math import inf, radians
from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.lpv_mpc.constraints import bound
from colibri.autopilot.control.lpv_mpc.cost import Integers, PlanReferences, Problem, cost
from colibri.autopilot.control.lpv_mpc.deviations import StepTransition, respond
from colibri.autopilot.control.lpv_mpc.feed_forward import follow, lead
from colibri.autopilot.control.lpv_mpc.model import Disturbance, Drive, roll_out
from colibri.autopilot.control.lpv_mpc.path import PathNow, SpeedEffects, fill_slides, price
from colibri.autopilot.control.parts.thrust_force import ForceLimits
from colibri.autopilot.control.qp import Qp
from colibri.autopilot.control.vehicle_model.battery import common_speed, drawn_ah, fill_limits, open_voltage, terminal
from colibri.autopilot.control.vehicle_model.disturbance_observer import ESTIMATES, limit_near_ground, observe
from colibri.autopilot.control.vehicle_model.drag import with_learned
from colibri.autopilot.control.vehicle_model.mass import follow_mass
from colibri.common.compiled_rotations import rotation_matrix
from colibri.common.elementary import cos
from colibri.common.jit import Packed, compiled, inlined
from colibri.common.matrices import dot, put
from colibri.common.types import Array, Quaternion, Vector

PREDICTED = 12  # position and velocity, ENU; phi, theta, psi; p, q, r; then m squared rotor speeds
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
    correct(commands, corrections[1:], starts, nominal)
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


@inlined
def correct(commands: Array, corrections: Array, starts: Integers, out: Array) -> None:
    for block in range(corrections.shape[0]):
        for step in range(starts[block], starts[block + 1]):
            for rotor in range(commands.shape[1]):
                out[step, rotor] = commands[step, rotor] + corrections[block, rotor]
