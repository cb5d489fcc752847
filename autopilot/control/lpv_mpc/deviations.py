"""Deviations of the vehicle from its nominal motion, as compiled kernels.

State, 12, driven by the squared rotor speeds:

    [position, m, ENU; velocity, m/s, ENU; rotation vector, rad, FLU; body rates, rad/s, FLU]

The last index of every array runs over steps or columns, so that loops over it are vectorised.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.lpv_mpc.model import LEAST_SPEED, RIGID, Model
from colibri.common.compiled_rotations import rotation_matrix
from colibri.common.jit import Packed, compiled, inlined, noalias, opened, packed
from colibri.common.types import Array

DEVIATIONS = 12
VECTOR = 8  # numbers in the longest vectors of today's CPUs
POSITION, VELOCITY, ROTATION, RATE = 0, 3, 6, 9


class StepTransition(NamedTuple):
    """Blocks of the transition of every step, (3, 3, N), or (3, m, N) from m rotors."""

    drag: Array  # velocity to velocity, without the unit matrix
    velocity_rotation: Array
    velocity_rate: Array
    position_rotation: Array
    position_rate: Array
    rotation: Array
    rotation_rate: Array
    rate: Array
    force: Array  # mean squared speeds over the step to velocity
    place: Array  # to position
    moment: Array  # to rates
    turn: Array  # to rotation
    spin: Array  # change of squared speeds to the rate r, (m, N)
    up: Array  # body z axis, ENU, (3, N)
    V: Array  # derivative of velocity by rotation
    W: Array  # derivative of rotation by rotation
    G: Array  # derivative of rates by rates


def empty_transition(steps: int, rotors: int) -> StepTransition:
    nine, driven = [np.zeros((3, 3, steps)) for _ in range(11)], [np.zeros((3, rotors, steps)) for _ in range(4)]
    return StepTransition._make([*nine[:8], *driven, np.zeros((rotors, steps)), np.zeros((3, steps)), *nine[8:]])


@inlined
def _linearise(motion: Array, speeds: Array, model: Model, out: StepTransition) -> None:
    _differentiate(motion, speeds, model, out)
    V, W, G, h = out.V, out.W, out.G, model.interval_s
    for i in range(3):
        for j in range(3):
            unit = 1.0 if i == j else 0.0
            for n in range(W.shape[2]):
                v, w, g = V[i, j, n], W[i, j, n], G[i, j, n]
                vw, vg, ww = _product(V, W, i, j, n), _product(V, G, i, j, n), _product(W, W, i, j, n)
                wg, gg = _product(W, G, i, j, n), _product(G, G, i, j, n)
                out.rotation[i, j, n] = unit + h * (w + 0.5 * h * ww)
                out.rotation_rate[i, j, n] = h * (unit + 0.5 * h * (w + g) + h * h / 6.0 * (ww + wg + gg))
                out.rate[i, j, n] = unit + h * (g + 0.5 * h * gg)
                out.velocity_rotation[i, j, n] = h * (v + 0.5 * h * vw)
                out.velocity_rate[i, j, n] = 0.5 * h * h * (v + h / 3.0 * (vw + vg))
                out.position_rotation[i, j, n] = 0.5 * h * h * (v + h / 3.0 * vw)
                out.position_rate[i, j, n] = h * h * h / 6.0 * v
    _drive(model, out)


@inlined
def _differentiate(motion: Array, speeds: Array, model: Model, out: StepTransition) -> None:
    airframe, inertia, allocation, h = model.airframe, model.inertia, model.allocation, model.interval_s
    ix, iy, iz = inertia[0], inertia[1], inertia[2]
    V, W, G = out.V, out.W, out.G
    for n in range(W.shape[2]):
        x, to = motion[n], motion[n + 1]
        qw, qx, qy, qz = x[6] + to[6], x[7] + to[7], x[8] + to[8], x[9] + to[9]
        length = sqrt(qw * qw + qx * qx + qy * qy + qz * qz)
        R = rotation_matrix((qw / length, qx / length, qy / length, qz / length))
        p, q, r = 0.5 * (x[10] + to[10]), 0.5 * (x[11] + to[11]), 0.5 * (x[12] + to[12])
        thrust, momentum = 0.0, 0.0
        for i in range(len(model.momentum)):
            squared = 0.5 * (speeds[n, i] + speeds[n + 1, i])
            speed = sqrt(max(squared, 0.0))
            thrust += allocation[0, i] * squared
            momentum += model.momentum[i] * speed
            out.spin[i, n] = -0.5 * model.momentum[i] / (max(speed, LEAST_SPEED) * iz)
        W[0, 1, n], W[0, 2, n], W[1, 0, n], W[1, 2, n], W[2, 0, n], W[2, 1, n] = r, -q, -r, p, q, -p
        G[0, 1, n], G[0, 2, n] = ((iy - iz) * r - momentum) / ix, (iy - iz) * q / ix
        G[1, 0, n], G[1, 2, n] = ((iz - ix) * r + momentum) / iy, (iz - ix) * p / iy
        G[2, 0, n], G[2, 1, n] = (ix - iy) * q / iz, (ix - iy) * p / iz
        across = airframe.drag_xy + airframe.rotor_drag * sqrt(max(thrust, 0.0))
        for i in range(3):
            out.up[i, n] = R[i][2]
            V[i, 0, n], V[i, 1, n] = -thrust / airframe.mass_kg * R[i][1], thrust / airframe.mass_kg * R[i][0]
            for j in range(3):
                along = R[i][2] * R[j][2]
                unit = 1.0 if i == j else 0.0
                out.drag[i, j, n] = -h * (across * (unit - along) + airframe.drag_z * along) / airframe.mass_kg


@inlined
def _product(A: Array, B: Array, i: int, j: int, n: int) -> float:
    total: float = 0.0 + A[i, 0, n] * B[0, j, n] + A[i, 1, n] * B[1, j, n] + A[i, 2, n] * B[2, j, n]
    return total


@inlined
def _drive(model: Model, out: StepTransition) -> None:
    inertia, allocation, h = model.inertia, model.allocation, model.interval_s
    for i in range(3):
        for rotor in range(len(model.momentum)):
            thrust = allocation[0, rotor]
            for n in range(out.up.shape[1]):
                force = out.up[i, n] * thrust / model.airframe.mass_kg
                out.force[i, rotor, n], out.place[i, rotor, n] = h * force, 0.5 * h * h * force
                out.moment[i, rotor, n], out.turn[i, rotor, n] = 0.0, 0.0
            for j in range(3):
                unit = 1.0 if i == j else 0.0
                turning = allocation[1 + j, rotor] / inertia[j]
                for n in range(out.up.shape[1]):
                    w, g = out.W[i, j, n], out.G[i, j, n]
                    out.moment[i, rotor, n] += h * (unit + 0.5 * h * g) * turning
                    out.turn[i, rotor, n] += 0.5 * h * h * (unit + h / 3.0 * (w + g)) * turning
                    out.force[i, rotor, n] += h * h * h / 6.0 * out.V[i, j, n] * turning


@inlined
def respond(
    motion: Array, speeds: Array, means: Array, levels: Array, packed: Packed, T: StepTransition, responses: Array
) -> None:
    """Write the deviations by a unit change of one rotor's command in one block.

    `means`, (b, N), and `levels`, (b, N + 1), are the squared speeds by that change over steps and at their ends;
    column m j + i of `responses` is rotor i in block j. Before its block it stays as it was: zero.
    """
    model = packed[0]
    inputs = responses.shape[2] // means.shape[0]
    responses[0] = 0.0
    _linearise(motion, speeds, model, T)
    for step in range(motion.shape[0] - 1):
        blocks = means.shape[0]
        while means[blocks - 1, step] == 0.0:  # not begun; without lag, those before have ended, too
            blocks -= 1
        X = responses[step + 1]
        _advance(responses[step], X, step, T, model.interval_s, inputs * blocks)
        for block in range(blocks):
            mean, change = means[block, step], levels[block, step + 1] - levels[block, step]
            for rotor in range(len(model.momentum)):
                column = inputs * block + rotor
                for i in range(3):
                    X[POSITION + i, column] += T.place[i, rotor, step] * mean
                    X[VELOCITY + i, column] += T.force[i, rotor, step] * mean
                    X[ROTATION + i, column] += T.turn[i, rotor, step] * mean
                    X[RATE + i, column] += T.moment[i, rotor, step] * mean
                X[RATE + 2, column] += T.spin[rotor, step] * change


@noalias
def _advance(X: Array, to: Array, n: int, T: StepTransition, h: float, begun: int) -> None:
    """Advance the first `begun` columns, and others with them: whole vectors of columns."""
    for i in range(3):
        pr0, pr1, pr2 = T.position_rotation[i, 0, n], T.position_rotation[i, 1, n], T.position_rotation[i, 2, n]
        pw0, pw1, pw2 = T.position_rate[i, 0, n], T.position_rate[i, 1, n], T.position_rate[i, 2, n]
        d0, d1, d2 = T.drag[i, 0, n], T.drag[i, 1, n], T.drag[i, 2, n]
        vr0, vr1, vr2 = T.velocity_rotation[i, 0, n], T.velocity_rotation[i, 1, n], T.velocity_rotation[i, 2, n]
        vw0, vw1, vw2 = T.velocity_rate[i, 0, n], T.velocity_rate[i, 1, n], T.velocity_rate[i, 2, n]
        rr0, rr1, rr2 = T.rotation[i, 0, n], T.rotation[i, 1, n], T.rotation[i, 2, n]
        rw0, rw1, rw2 = T.rotation_rate[i, 0, n], T.rotation_rate[i, 1, n], T.rotation_rate[i, 2, n]
        ww0, ww1, ww2 = T.rate[i, 0, n], T.rate[i, 1, n], T.rate[i, 2, n]
        for c in range(min(-(-begun // VECTOR) * VECTOR, X.shape[1])):
            v0, v1, v2 = X[VELOCITY, c], X[VELOCITY + 1, c], X[VELOCITY + 2, c]
            r0, r1, r2 = X[ROTATION, c], X[ROTATION + 1, c], X[ROTATION + 2, c]
            w0, w1, w2 = X[RATE, c], X[RATE + 1, c], X[RATE + 2, c]
            place, fall = X[POSITION + i, c] + h * X[VELOCITY + i, c], X[VELOCITY + i, c]
            to[POSITION + i, c] = place + (pr0 * r0 + pw0 * w0) + (pr1 * r1 + pw1 * w1) + (pr2 * r2 + pw2 * w2)
            fall += d0 * v0 + vr0 * r0 + vw0 * w0
            fall += d1 * v1 + vr1 * r1 + vw1 * w1
            to[VELOCITY + i, c] = fall + (d2 * v2 + vr2 * r2 + vw2 * w2)
            to[ROTATION + i, c] = 0.0 + (rr0 * r0 + rw0 * w0) + (rr1 * r1 + rw1 * w1) + (rr2 * r2 + rw2 * w2)
            to[RATE + i, c] = 0.0 + ww0 * w0 + ww1 * w1 + ww2 * w2


class _Linearised(NamedTuple):
    motion: Array  # (N + 1, 13)
    speeds: Array  # squared, (N + 1, m)
    transition: StepTransition


@compiled
def _fill_transition(flight: Packed, vehicle: Packed) -> None:
    _linearise(flight[0].motion, flight[0].speeds, vehicle[0], flight[0].transition)


def hover_transition(thrust_n: float, vehicle: Packed, steps: int) -> tuple[Array, Array]:
    """Return A, (12 + m, 12 + m), and B, (12 + m, m), of deviations and squared speeds in level flight.

    It shares the compiled code of a plan of as many `steps`.
    """
    rotors, h, level = vehicle["momentum"].shape[1], vehicle["interval_s"][0], np.zeros((steps + 1, RIGID))
    level[:, 6] = 1.0
    speeds = np.full((steps + 1, rotors), thrust_n / np.cumsum(vehicle["allocation"][0, 0])[-1])
    flight = packed(_Linearised(level, speeds, empty_transition(steps, rotors)))
    _fill_transition(flight, vehicle)
    T = StepTransition(*(part[..., 0] for part in opened(flight["transition"], StepTransition)))
    lag, n, one, none = vehicle[0]["lag"], DEVIATIONS + rotors, np.eye(3), np.zeros((3, 3))
    A, B = np.zeros((n, n)), np.zeros((n, rotors))
    A[:DEVIATIONS, :DEVIATIONS] += np.block(
        [
            [one, h * one, T.position_rotation, T.position_rate],
            [none, one + T.drag, T.velocity_rotation, T.velocity_rate],
            [none, none, T.rotation, T.rotation_rate],
            [none, none, none, T.rate],
        ]
    )
    effects = np.concatenate([T.place, T.force, T.turn, T.moment])
    A[:DEVIATIONS, DEVIATIONS:], B[:DEVIATIONS] = effects * lag["left_mean"], effects * (1.0 - lag["left_mean"])
    A[RATE + 2, DEVIATIONS:] += T.spin * (lag["left"] - 1.0)
    B[RATE + 2] += T.spin * (1.0 - lag["left"])
    A[DEVIATIONS:, DEVIATIONS:], B[DEVIATIONS:] = lag["left"] * np.eye(rotors), (1.0 - lag["left"]) * np.eye(rotors)
    return A, B
