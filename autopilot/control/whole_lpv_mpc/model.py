"""The whole vehicle as its control law models it, as compiled kernels: a nominal motion, and deviations from it.

The nominal motion is a Runge-Kutta rollout of the rigid body under the commands that are expected, from the state now.
About it the deviations are linear, with the model's matrices at the middle of each step; their 12 states are

    [position, m, ENU; velocity, m/s, ENU; rotation vector, rad, FLU; body rates, rad/s, FLU]

and the rotors' squared speeds drive them. Those follow their commands as one linear lag, so that they are known
functions of the commands: see `Lag`. Squared speeds are in parts of the vehicle's largest.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.vehicle_model.airframe import Airframe, drag_force
from colibri.common.compiled_rotations import rotation_matrix
from colibri.common.jit import Packed, compiled
from colibri.common.types import Array

DEVIATIONS = 12
POSITION, VELOCITY, ROTATION, RATE = 0, 3, 6, 9
ROTORS = 4
RIGID = 13
"""States of a nominal motion: position and velocity, ENU; quaternion wxyz, FLU to ENU; body rates, FLU."""
_QUATERNION, _BODY_RATE = 6, 10
_LEAST_SPEED = 1e-3
"""A rotor that stands has no speed to divide by."""


class Lag(NamedTuple):
    """How squared rotor speeds s follow commands u that are held for a step of h: ds/dt = (u - s) / τ.

    Attributes:
        left: exp(-h / τ), the part of u - s that is left after a step; 0 for rotors that follow at once.
        left_half: The same after half a step.
        left_mean: Its mean over the step.
        rate_1_s: 1 / τ; 0 for rotors that follow at once.
    """

    left: float
    left_half: float
    left_mean: float
    rate_1_s: float


class Model(NamedTuple):
    """A vehicle's numbers.

    Attributes:
        airframe: Mass, gravity and drag.
        inertia: Ix, Iy, Iz, kg m², (3,).
        allocation: From squared speeds to U1, N, and U2, U3, U4, N m, (4, 4).
        momentum: Angular momentum of each rotor along body z at its largest speed, N m s, (4,).
        lag: Of the rotors.
        interval_s: Of a step.
    """

    airframe: Airframe
    inertia: Array
    allocation: Array
    momentum: Array
    lag: Lag
    interval_s: float


class Disturbance(NamedTuple):
    """What the model does not explain, constant over the horizon: m/s², ENU, (3,), and N m, FLU, (3,)."""

    acceleration: Array
    moment: Array


@compiled
def roll_out(
    rigid: Array,
    squared: Array,
    commands: Array,
    disturbance: Disturbance,
    packed: Packed,
    motion: Array,
    speeds: Array,
) -> None:
    """Write the nominal motion under commands.

    Args:
        rigid: State now, (13,).
        squared: Squared rotor speeds now, (4,).
        commands: Squared speeds commanded at each step, (N, 4).
        disturbance: On the vehicle.
        packed: The `Model`.
        motion: Is filled with the state now and after each step, (N + 1, 13).
        speeds: Is filled with the squared rotor speeds at the same times, (N + 1, 4).
    """
    model = packed[0]
    lag, h = model.lag, model.interval_s
    half, after = np.empty(ROTORS), np.empty(ROTORS)
    k1, k2, k3, k4, at = np.empty(RIGID), np.empty(RIGID), np.empty(RIGID), np.empty(RIGID), np.empty(RIGID)
    motion[0] = rigid
    speeds[0] = squared
    for step in range(commands.shape[0]):
        x, before, command = motion[step], speeds[step], commands[step]
        for i in range(ROTORS):
            away = before[i] - command[i]
            half[i] = command[i] + away * lag.left_half
            after[i] = command[i] + away * lag.left
        begin = after if lag.rate_1_s == 0.0 else before
        _write_rates(x, begin, command, disturbance, model, k1)
        for i in range(RIGID):
            at[i] = x[i] + 0.5 * h * k1[i]
        _write_rates(at, half, command, disturbance, model, k2)
        for i in range(RIGID):
            at[i] = x[i] + 0.5 * h * k2[i]
        _write_rates(at, half, command, disturbance, model, k3)
        for i in range(RIGID):
            at[i] = x[i] + h * k3[i]
        _write_rates(at, after, command, disturbance, model, k4)
        to = motion[step + 1]
        for i in range(RIGID):
            to[i] = x[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])
        q = to[_QUATERNION:_BODY_RATE]
        length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        for i in range(4):
            q[i] /= length
        speeds[step + 1] = after


@compiled
def _write_rates(
    x: Array, squared: Array, command: Array, disturbance: Disturbance, model: Model, rates: Array
) -> None:
    """Write dx/dt of the rigid body, (13,), whose rotors, (4,), turn at `squared` and are commanded to `command`."""
    airframe, inertia, allocation = model.airframe, model.inertia, model.allocation
    thrust, roll, pitch, yaw = 0.0, 0.0, 0.0, 0.0
    momentum, spin_up = 0.0, 0.0
    for i in range(ROTORS):
        s = max(squared[i], 0.0)
        speed = max(sqrt(s), _LEAST_SPEED)
        thrust += allocation[0, i] * s
        roll += allocation[1, i] * s
        pitch += allocation[2, i] * s
        yaw += allocation[3, i] * s
        momentum += model.momentum[i] * speed
        spin_up += model.momentum[i] * 0.5 * (command[i] - s) * model.lag.rate_1_s / speed
    qw, qx, qy, qz = x[6], x[7], x[8], x[9]
    p, q, r = x[10], x[11], x[12]
    up = (2.0 * (qx * qz + qw * qy), 2.0 * (qy * qz - qw * qx), 1.0 - 2.0 * (qx * qx + qy * qy))
    drag = drag_force(airframe, (x[3], x[4], x[5]), up, thrust)
    for i in range(3):
        rates[i] = x[VELOCITY + i]
        rates[VELOCITY + i] = (thrust * up[i] + drag[i]) / airframe.mass_kg + disturbance.acceleration[i]
    rates[VELOCITY + 2] -= airframe.gravity_m_s2
    rates[6] = -0.5 * (qx * p + qy * q + qz * r)
    rates[7] = 0.5 * (qw * p + qy * r - qz * q)
    rates[8] = 0.5 * (qw * q + qz * p - qx * r)
    rates[9] = 0.5 * (qw * r + qx * q - qy * p)
    ix, iy, iz = inertia[0], inertia[1], inertia[2]
    rates[10] = (roll + disturbance.moment[0] + (iy - iz) * q * r - momentum * q) / ix
    rates[11] = (pitch + disturbance.moment[1] + (iz - ix) * p * r + momentum * p) / iy
    rates[12] = (yaw + disturbance.moment[2] + (ix - iy) * p * q - spin_up) / iz


class Transition(NamedTuple):
    """One step of the deviations, by its blocks that are not known beforehand; each is (3, 3) or (3, 4).

    Attributes:
        drag: Of velocity on velocity, beyond the unit matrix.
        velocity_rotation, velocity_rate: Of rotation and rates on velocity.
        position_rotation, position_rate: The same on position.
        rotation, rotation_rate: Of rotation and rates on rotation.
        rate: Of rates on rates.
        force, place: Of the mean squared speeds over the step on velocity and position.
        moment, turn: The same on rates and rotation.
        spin: Of the change of squared speeds over the step on the rate r, (4,).
        V, W, G: Derivatives that all are made of: of velocity and rotation by rotation, and of rates by rates.
    """

    drag: Array
    velocity_rotation: Array
    velocity_rate: Array
    position_rotation: Array
    position_rate: Array
    rotation: Array
    rotation_rate: Array
    rate: Array
    force: Array
    place: Array
    moment: Array
    turn: Array
    spin: Array
    V: Array
    W: Array
    G: Array


@compiled
def _empty_transition() -> Transition:
    nine, twelve = (3, 3), (3, ROTORS)
    return Transition(
        np.empty(nine), np.empty(nine), np.empty(nine), np.empty(nine), np.empty(nine), np.empty(nine), np.empty(nine),
        np.empty(nine), np.empty(twelve), np.empty(twelve), np.empty(twelve), np.empty(twelve), np.empty(ROTORS),
        np.zeros(nine), np.zeros(nine), np.zeros(nine),
    )  # fmt: skip


@compiled
def _linearise(x: Array, to: Array, squared: Array, model: Model, out: Transition) -> None:
    """Fill the transition of a step from `x` to `to`, (13,) each, with mean squared rotor speeds `squared`, (4,).

    Taylor's series to the third power of the step, its matrices those of the step's middle.
    """
    airframe, inertia, allocation, h = model.airframe, model.inertia, model.allocation, model.interval_s
    qw, qx, qy, qz = x[6] + to[6], x[7] + to[7], x[8] + to[8], x[9] + to[9]
    length = sqrt(qw * qw + qx * qx + qy * qy + qz * qz)
    R = rotation_matrix((qw / length, qx / length, qy / length, qz / length))
    p, q, r = 0.5 * (x[10] + to[10]), 0.5 * (x[11] + to[11]), 0.5 * (x[12] + to[12])
    thrust, momentum = 0.0, 0.0
    for i in range(ROTORS):
        speed = sqrt(max(squared[i], 0.0))
        thrust += allocation[0, i] * squared[i]
        momentum += model.momentum[i] * speed
        out.spin[i] = -0.5 * model.momentum[i] / (max(speed, _LEAST_SPEED) * inertia[2])
    ix, iy, iz = inertia[0], inertia[1], inertia[2]
    V, W, G, D = out.V, out.W, out.G, out.drag
    W[0, 1], W[0, 2], W[1, 0], W[1, 2], W[2, 0], W[2, 1] = r, -q, -r, p, q, -p
    G[0, 1], G[0, 2] = ((iy - iz) * r - momentum) / ix, (iy - iz) * q / ix
    G[1, 0], G[1, 2] = ((iz - ix) * r + momentum) / iy, (iz - ix) * p / iy
    G[2, 0], G[2, 1] = (ix - iy) * q / iz, (ix - iy) * p / iz
    across = airframe.drag_xy + airframe.rotor_drag * sqrt(max(thrust, 0.0))
    for i in range(3):
        V[i, 0], V[i, 1] = -thrust / airframe.mass_kg * R[i][1], thrust / airframe.mass_kg * R[i][0]
        for j in range(3):
            along = R[i][2] * R[j][2]
            unit = 1.0 if i == j else 0.0
            D[i, j] = -h * (across * (unit - along) + airframe.drag_z * along) / airframe.mass_kg
    for i in range(3):
        for j in range(3):
            unit = 1.0 if i == j else 0.0
            vw, vg, ww, wg, gg = 0.0, 0.0, 0.0, 0.0, 0.0
            for k in range(2):
                vw += V[i, k] * W[k, j]
                vg += V[i, k] * G[k, j]
            for k in range(3):
                ww += W[i, k] * W[k, j]
                wg += W[i, k] * G[k, j]
                gg += G[i, k] * G[k, j]
            out.rotation[i, j] = unit + h * (W[i, j] + 0.5 * h * ww)
            out.rotation_rate[i, j] = h * (unit + 0.5 * h * (W[i, j] + G[i, j]) + h * h / 6.0 * (ww + wg + gg))
            out.rate[i, j] = unit + h * (G[i, j] + 0.5 * h * gg)
            out.velocity_rotation[i, j] = h * (V[i, j] + 0.5 * h * vw)
            out.velocity_rate[i, j] = 0.5 * h * h * (V[i, j] + h / 3.0 * (vw + vg))
            out.position_rotation[i, j] = 0.5 * h * h * (V[i, j] + h / 3.0 * vw)
            out.position_rate[i, j] = h * h * h / 6.0 * V[i, j]
    for i in range(3):
        for rotor in range(ROTORS):
            force = R[i][2] * allocation[0, rotor] / airframe.mass_kg
            out.force[i, rotor], out.place[i, rotor] = h * force, 0.5 * h * h * force
            out.moment[i, rotor], out.turn[i, rotor] = 0.0, 0.0
        for j in range(3):
            unit = 1.0 if i == j else 0.0
            moved = h * (unit + 0.5 * h * G[i, j])
            turned = 0.5 * h * h * (unit + h / 3.0 * (W[i, j] + G[i, j]))
            lifted = h * h * h / 6.0 * V[i, j]
            for rotor in range(ROTORS):
                turning = allocation[1 + j, rotor] / inertia[j]
                out.moment[i, rotor] += moved * turning
                out.turn[i, rotor] += turned * turning
                out.force[i, rotor] += lifted * turning


@compiled
def respond(motion: Array, speeds: Array, means: Array, levels: Array, packed: Packed, responses: Array) -> None:
    """Write how the motion deviates for a unit change of one rotor's command held for one block.

    Args:
        motion: Nominal, (N + 1, 13).
        speeds: Nominal squared rotor speeds, (N + 1, 4).
        means: Of each block, the mean squared speed over each step that its unit change leads to, (b, N).
        levels: The same at the beginning of each step and after the last, (b, N + 1).
        packed: The `Model`.
        responses: Is filled, (N + 1, 12, 4 b); column 4 j + i is rotor i in block j.
    """
    model = packed[0]
    T = _empty_transition()
    inputs = responses.shape[2] // means.shape[0]
    responses[0] = 0.0
    squared = np.empty(ROTORS)
    for step in range(speeds.shape[0] - 1):
        for rotor in range(ROTORS):
            squared[rotor] = 0.5 * (speeds[step, rotor] + speeds[step + 1, rotor])
        _linearise(motion[step], motion[step + 1], squared, model, T)
        blocks = 0
        while blocks < means.shape[0] and means[blocks, step] != 0.0:
            blocks += 1
        used = inputs * blocks
        _advance(responses[step], T, model.interval_s, used, responses[step + 1])
        X = responses[step + 1]
        for block in range(blocks):
            mean, change = means[block, step], levels[block, step + 1] - levels[block, step]
            for rotor in range(ROTORS):
                column = inputs * block + rotor
                for i in range(3):
                    X[POSITION + i, column] += T.place[i, rotor] * mean
                    X[VELOCITY + i, column] += T.force[i, rotor] * mean
                    X[ROTATION + i, column] += T.turn[i, rotor] * mean
                    X[RATE + i, column] += T.moment[i, rotor] * mean
                X[RATE + 2, column] += T.spin[rotor] * change
        X[:, used:] = 0.0


@compiled
def _advance(X: Array, T: Transition, h: float, used: int, after: Array) -> None:
    """Write the first columns of X, (12, 4 b), a step later."""
    for i in range(3):
        place, fall, turn, spin = after[POSITION + i], after[VELOCITY + i], after[ROTATION + i], after[RATE + i]
        for c in range(used):
            place[c] = X[POSITION + i, c] + h * X[VELOCITY + i, c]
            fall[c] = X[VELOCITY + i, c]
            turn[c] = 0.0
            spin[c] = 0.0
        for j in range(3):  # a loop for each row written: those that name more arrays are not vectorised
            pr, pw = T.position_rotation[i, j], T.position_rate[i, j]
            d, vr, vw = T.drag[i, j], T.velocity_rotation[i, j], T.velocity_rate[i, j]
            rr, rw, ww = T.rotation[i, j], T.rotation_rate[i, j], T.rate[i, j]
            v, rotation, rate = X[VELOCITY + j], X[ROTATION + j], X[RATE + j]
            for c in range(used):
                place[c] += pr * rotation[c] + pw * rate[c]
            for c in range(used):
                fall[c] += d * v[c] + vr * rotation[c] + vw * rate[c]
            for c in range(used):
                turn[c] += rr * rotation[c] + rw * rate[c]
            for c in range(used):
                spin[c] += ww * rate[c]


@compiled
def hover_transition(thrust_n: float, packed: Packed) -> tuple[Array, Array]:
    """Return A, (16, 16), and B, (16, 4), of one step of deviations and squared rotor speeds, level at a thrust."""
    model = packed[0]
    lag, allocation = model.lag, model.allocation
    level, squared = np.zeros(RIGID), np.empty(ROTORS)
    level[_QUATERNION] = 1.0
    total = 0.0
    for i in range(ROTORS):
        total += allocation[0, i]
    squared[:] = thrust_n / total
    T = _empty_transition()
    _linearise(level, level, squared, model, T)
    n = DEVIATIONS + ROTORS
    A, B = np.zeros((n, n)), np.zeros((n, ROTORS))
    _advance(np.eye(DEVIATIONS), T, model.interval_s, DEVIATIONS, A[:DEVIATIONS, :DEVIATIONS])
    for rotor in range(ROTORS):
        for i in range(3):
            effects = (T.place[i, rotor], T.force[i, rotor], T.turn[i, rotor], T.moment[i, rotor])
            for part in range(4):
                A[3 * part + i, DEVIATIONS + rotor] = effects[part] * lag.left_mean
                B[3 * part + i, rotor] = effects[part] * (1.0 - lag.left_mean)
        A[RATE + 2, DEVIATIONS + rotor] += T.spin[rotor] * (lag.left - 1.0)
        B[RATE + 2, rotor] += T.spin[rotor] * (1.0 - lag.left)
        A[DEVIATIONS + rotor, DEVIATIONS + rotor] = lag.left
        B[DEVIATIONS + rotor, rotor] = 1.0 - lag.left
    return A, B
