"""From the last plan to the next QP, and from its solution to the next plan, as two compiled kernels.

Commands and corrections are squared rotor speeds in parts of the largest; see `condensing`.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.qp import Qp
from colibri.autopilot.control.whole_lpv_mpc.condensing import (
    MOTION_ROWS,
    Target,
    bound,
    carry_over,
    cost,
    limit_motion,
    read_plan,
)
from colibri.autopilot.control.whole_lpv_mpc.feed_forward import lead
from colibri.autopilot.control.whole_lpv_mpc.model import ROTORS, Disturbance, respond, roll_out
from colibri.common.jit import Packed, compiled
from colibri.common.types import Array

_BINDING = 1e-9
"""A limit counts as active where this or less is left."""


class Now(NamedTuple):
    """Where a plan begins.

    Attributes:
        rigid: State, see `model.RIGID`, (13,).
        psi: Yaw, rad, unwrapped.
        squared: Squared rotor speeds, (4,).
        disturbance: That the model does not explain.
        limits: Least and largest squared speed of each step, (N, 2).
    """

    rigid: Array
    psi: float
    squared: Array
    disturbance: Disturbance
    limits: Array


class Workspace(NamedTuple):
    """Arrays that every plan fills again.

    Attributes:
        commands: Of the references, within the limits, (N, 4).
        corrections: Nominal, of what flew last and of each block, (b + 1, 4).
        motion, speeds: Nominal, (N + 1, 13) and (N + 1, 4).
        responses: (N + 1, 12, 4 b).
        means, levels: Of `model.respond`, (b, N) and (b, N + 1).
    """

    commands: Array
    corrections: Array
    motion: Array
    speeds: Array
    responses: Array
    means: Array
    levels: Array


@compiled
def condense(now: Now, target: Target, last: Array, vehicle: Packed, packed: Packed, work: Workspace, qp: Qp) -> None:
    """Fill the QP within the rotors' limits.

    Args:
        now: Where the plan begins.
        target: What it is to follow.
        last: Corrections of the last plan, from that which flew last on, (n, 4); (0, 4) without one.
        vehicle: The `Model`.
        packed: The `Problem`.
        work: Is filled.
        qp: Is filled, but for G and h.
    """
    starts = packed[0].starts
    commands, corrections = work.commands, work.corrections
    lead(target.squared, vehicle[0].lag.left, now.limits, commands)
    corrections[:] = 0.0
    if last.shape[0] > 0:
        carry_over(last, starts, corrections)
    bound(commands, now.limits, corrections[1:], starts, qp.lower, qp.upper)
    nominal = np.empty_like(commands)
    _correct(commands, corrections[1:], starts, nominal)
    roll_out(now.rigid, now.squared, nominal, now.disturbance, vehicle, work.motion, work.speeds)
    respond(work.motion, work.speeds, work.means, work.levels, vehicle, work.responses)
    cost(work.motion, work.speeds, work.responses, target, corrections, packed, qp.H, qp.f)


@compiled
def free_minimum(qp: Qp, z: Array) -> bool:
    """Write the minimum of the cost alone, (n,), by Cholesky's factors; whether it lies within all bounds."""
    n = z.shape[0]
    L = np.empty((n, n))
    for i in range(n):
        for j in range(i + 1):
            total = qp.H[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            if i > j:
                L[i, j] = total / L[j, j]
            elif total > 0.0:
                L[i, i] = sqrt(total)
            else:
                return False
    for i in range(n):
        total = -qp.f[i]
        for k in range(i):
            total -= L[i, k] * z[k]
        z[i] = total / L[i, i]
    for i in range(n - 1, -1, -1):
        total = z[i]
        for k in range(i + 1, n):
            total -= L[k, i] * z[k]
        z[i] = total / L[i, i]
    within = True
    for i in range(n):
        within = within and qp.lower[i] <= z[i] <= qp.upper[i]
    return within


@compiled
def read(work: Workspace, qp: Qp, z: Array, psi: float, packed: Packed) -> tuple[Array, Array, Array, int]:
    """Return the plan that z, (n,), stands for, `psi` unwrapped: see `Plan`; and how many bounds of commands bind."""
    starts = packed[0].starts
    corrections, held, commands = (
        work.corrections[1:].copy(),
        np.empty_like(work.commands),
        np.empty_like(work.commands),
    )
    binding = 0
    for block in range(corrections.shape[0]):
        for rotor in range(ROTORS):
            k = ROTORS * block + rotor
            corrections[block, rotor] += z[k]
            if z[k] <= qp.lower[k] + _BINDING or z[k] >= qp.upper[k] - _BINDING:
                binding += 1
    _correct(np.zeros_like(held), corrections, starts, held)
    _correct(work.commands, corrections, starts, commands)
    states = read_plan(work.motion, work.speeds, work.responses, z, work.levels, psi)
    return held, commands, states, binding


@compiled
def _correct(commands: Array, corrections: Array, starts: Array, out: Array) -> None:
    """Write commands, (N, 4), plus the correction of each one's block, (b, 4)."""
    for block in range(corrections.shape[0]):
        for step in range(starts[block], starts[block + 1]):
            for rotor in range(ROTORS):
                out[step, rotor] = commands[step, rotor] + corrections[block, rotor]


@compiled
def limit(work: Workspace, free: Qp, packed: Packed, qp: Qp) -> None:
    """Fill a QP that has the soft limits, too, from that which has not."""
    moved = free.f.shape[0]
    qp.H[:moved, :moved] = free.H
    qp.f[:moved], qp.lower[:moved], qp.upper[:moved] = free.f, free.lower, free.upper
    limit_motion(work.motion, work.responses, packed, qp.G, qp.h)


@compiled
def count_active(qp: Qp, z: Array) -> tuple[int, int]:
    """Return how many soft limits of tilt and of rates have nothing left at z, (n,)."""
    tilts, rates = 0, 0
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
