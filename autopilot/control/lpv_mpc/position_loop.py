"""The outer loop over a horizon: references and feedback to attitudes and thrusts, as compiled kernels.

Thrust makes F = m (a_ref + k1 e + k2 e' + g - d) plus the drag, and F gives roll and pitch at the predicted yaw. Future
errors follow the closed loop. Flatness: Mellinger and Kumar, ICRA 2011; with drag: Faessler et al., RA-L 2018.

Samples are from now to one past the horizon, n = N + 2. The last argument is filled; `packed` is the `Loop`.
"""

from math import floor, pi, sqrt
from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.parts.thrust_force import ForceLimits, overcome_drag
from colibri.autopilot.control.vehicle_model.airframe import Airframe
from colibri.common.jit import Packed, compiled
from colibri.common.kernels import atan2, cos, sin
from colibri.common.matrices import norm
from colibri.common.types import Array


class Loop(NamedTuple):
    """Constants of the outer loop."""

    k1_s2: float  # on the position error
    k2_s: float  # on its rate
    errors_ahead: Array  # of `error_transition`, (N + 2, 2, 2)
    max_error_m: float  # of approach; the feed-forward of farther references shrinks in proportion
    airframe: Airframe
    inertia: Array  # kg m², (3,)
    follows: float  # part of the thrust's way to its command in a step
    interval_s: float


class Motion(NamedTuple):
    """The present motion of the vehicle."""

    position: Array  # m, ENU, (3,)
    velocity: Array  # m/s, ENU, (3,)
    up: Array  # body z axis, ENU, (3,)
    yaw_rad: float  # psi, unwrapped
    thrust_n: float  # U1
    mass_kg: float


class Demands(NamedTuple):
    """Demands over the horizon."""

    forces: Array  # N, ENU, (N + 2, 3)
    angles: Array  # phi, theta, psi, rad, (N + 2, 3)
    thrusts: Array  # commanded at each step, N, (N,)
    end: Array  # of `end_of_motion`, (12,)


@compiled
def wanted_forces(
    motion: Motion,
    references: tuple[Array, Array, Array, Array],  # position, velocity, acceleration, ENU, (n, 3), and yaw, (n,)
    disturbance_m_s2: Array,  # ENU, (3,)
    loop: Loop,
    limits: ForceLimits,
    forces: Array,  # N, ENU, (n, 3)
) -> None:
    airframe = loop.airframe
    e = references[0][0] - motion.position
    near = min(1.0, loop.max_error_m / max(norm(e), loop.max_error_m))
    e *= near
    e_rate = near * references[1][0] - motion.velocity
    k1, k2 = loop.k1_s2, loop.k2_s
    moving = np.empty(forces.shape)
    for n in range(forces.shape[0]):
        E = loop.errors_ahead[n]
        for i in range(3):
            ahead = E[0, 0] * e[i] + E[0, 1] * e_rate[i]
            ahead_rate = E[1, 0] * e[i] + E[1, 1] * e_rate[i]
            moving[n, i] = near * references[1][n, i] - ahead_rate
            demanded = near * references[2][n, i] + k1 * ahead + k2 * ahead_rate - disturbance_m_s2[i]
            forces[n, i] = motion.mass_kg * demanded
        forces[n, 2] += motion.mass_kg * airframe.gravity_m_s2
    overcome_drag(moving, airframe, limits, forces)


@compiled
def attitudes(forces: Array, yaw_wanted: Array, yaw_predicted: Array, angles: Array) -> None:
    """Fill roll and pitch along each force at the predicted yaw, and the wanted yaw."""
    for n in range(forces.shape[0]):
        c, s = cos(yaw_predicted[n]), sin(yaw_predicted[n])
        x, y, z = forces[n]
        ahead = x * c + y * s
        angles[n, 0] = atan2(x * s - y * c, sqrt(ahead * ahead + z * z))
        angles[n, 1] = atan2(ahead, z)
        angles[n, 2] = yaw_wanted[n]


@compiled
def thrust_commands(
    thrust_n: float, forces: Array, up: Array, follows: float, limits: ForceLimits, commands: Array
) -> None:
    """Fill the commands, N, (N,), that bring the lagging thrust to its reference at each step's end.

    The first reference is the force's component along body z; later ones assume the planned attitude.
    """
    for n in range(commands.shape[0]):
        force = forces[n + 1]
        wanted = force[0] * up[0] + force[1] * up[1] + force[2] * up[2] if n == 0 else norm(force)
        command = thrust_n + (wanted - thrust_n) / follows
        command = min(max(command, limits.min_n), limits.max_n)
        thrust_n += (command - thrust_n) * follows
        commands[n] = command


@compiled
def end_of_motion(angles: Array, inertia: Array, disturbance_n_m: Array, interval_s: float, end: Array) -> None:
    """Fill phi, p, theta, q, psi, r, M1..M3, U2..U4 at the last but one sample."""
    before, here, after = angles[-3], angles[-2], angles[-1]
    rate = (after - before) / (2.0 * interval_s)
    turn = (after - 2.0 * here + before) / (interval_s * interval_s)
    s, c = sin(here[0]), cos(here[0])
    st, ct = sin(here[1]), cos(here[1])
    body_rate = (rate[0] - st * rate[2], c * rate[1] + s * ct * rate[2], c * ct * rate[2] - s * rate[1])
    body_turn = (turn[0] - st * turn[2], c * turn[1] + s * ct * turn[2], c * ct * turn[2] - s * turn[1])
    for i in range(3):
        end[2 * i] = here[i]
        end[2 * i + 1] = body_rate[i]
        end[6 + i] = end[9 + i] = inertia[i] * body_turn[i] - disturbance_n_m[i]


@compiled
def yaw_ahead(yaw_rad: float, wanted: Array, planned: Array, ahead: Array) -> float:
    """Fill the expected yaw; return the full turns between it and the wanted yaw, rad.

    It follows the plan, (m,), then the rate of the wanted yaw, (n,).
    """
    ahead[0] = yaw_rad
    for n in range(1, ahead.shape[0]):
        path = planned if n < planned.shape[0] else wanted
        ahead[n] = ahead[n - 1] + path[n] - path[n - 1]
    turns: float = 2.0 * pi * floor((yaw_rad - wanted[0]) / (2.0 * pi) + 0.5)
    return turns


@compiled
def guide(
    motion: Motion,
    references: tuple[Array, Array, Array, Array],
    planned_yaw: Array,  # (m,)
    disturbances: Array,  # acceleration, m/s², ENU, and moment, N m, FLU, (6,)
    packed: Packed,
    limits: ForceLimits,
    out: Demands,
) -> float:
    """Compute all demands of references; return the cosine of the angle from thrust axis to force."""
    loop = packed[0]
    wanted_forces(motion, references, disturbances[:3], loop, limits, out.forces)
    ahead = np.empty(out.forces.shape[0])
    turns = yaw_ahead(motion.yaw_rad, references[3], planned_yaw, ahead)
    attitudes(out.forces, references[3] + turns, ahead, out.angles)
    thrust_commands(motion.thrust_n, out.forces, motion.up, loop.follows, limits, out.thrusts)
    end_of_motion(out.angles, loop.inertia, disturbances[3:], loop.interval_s, out.end)
    force, up = out.forces[0], motion.up
    aligned: float = (force[0] * up[0] + force[1] * up[1] + force[2] * up[2]) / norm(force)
    return aligned


@compiled
def hold_attitude(
    motion: Motion,
    demanded: tuple[Array, Array],  # angles, (n, 3), and thrusts, N, (n,)
    disturbance_n_m: Array,
    packed: Packed,
    limits: ForceLimits,
    out: Demands,
) -> float:
    """Compute the demands of an attitude; return the cosine as in `guide`.

    Only the first force is filled; psi moves to the vehicle's present turn.
    """
    loop = packed[0]
    angles, force, up = out.angles, out.forces[0], motion.up
    turns = 2.0 * pi * floor((motion.yaw_rad - demanded[0][0, 2]) / (2.0 * pi) + 0.5)
    along = np.zeros((angles.shape[0], 3))
    for n in range(angles.shape[0]):
        angles[n] = demanded[0][n]
        angles[n, 2] += turns
        along[n, 2] = min(max(demanded[1][n], limits.min_n), limits.max_n)
    thrust_commands(motion.thrust_n, along, np.array([0.0, 0.0, 1.0]), loop.follows, limits, out.thrusts)
    end_of_motion(angles, loop.inertia, disturbance_n_m, loop.interval_s, out.end)
    phi, theta, psi = angles[0]
    force[0] = along[0, 2] * (cos(phi) * sin(theta) * cos(psi) + sin(phi) * sin(psi))
    force[1] = along[0, 2] * (cos(phi) * sin(theta) * sin(psi) - sin(phi) * cos(psi))
    force[2] = along[0, 2] * cos(phi) * cos(theta)
    aligned: float = (force[0] * up[0] + force[1] * up[1] + force[2] * up[2]) / along[0, 2]
    return aligned
