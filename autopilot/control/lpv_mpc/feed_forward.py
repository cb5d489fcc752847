"""Rotor commands of the references by differential flatness, with drag, as compiled kernels.

Thrust force and yaw give the attitude; attitudes the rates and moments; with the thrust these give squared rotor
speeds; commands lead them by the lag. Derivatives beyond acceleration are differences, which include drag. Mellinger
and Kumar, ICRA 2011; with drag: Faessler, Franchi and Scaramuzza, RA-L 2018.

Samples are from now to one past the horizon, n = N + 2. Squared speeds are in parts of the largest.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.lpv_mpc.approach import approach, before_jump, feasible_part, stopping_s
from colibri.autopilot.control.lpv_mpc.model import Disturbance
from colibri.autopilot.control.parts.thrust_force import LEAST_N, ForceLimits, limited_force, overcome_drag
from colibri.common.compiled_rotations import rotation_matrix
from colibri.common.jit import Packed, compiled, inlined
from colibri.common.kernels import asin, atan2, cos, sin
from colibri.common.matrices import dot, norm, put
from colibri.common.types import Array

HEADING_ABOVE = 0.15  # least vertical part of body z at which the yaw has a meaning
_TWIST_RAD_S = 4.0  # of the return to it


class Flat(NamedTuple):
    """Flat outputs of references, filled in place."""

    forces: Array  # of the thrust, N, ENU, (n, 3)
    attitudes: Array  # body to earth, (n, 3, 3)
    rates: Array  # rad/s, FLU, at samples 1 to N, (N, 3)
    squared: Array  # rotor speeds at samples 0 to N, (N + 1, m)


@compiled
def follow(
    now: Packed,
    position: Array,  # ENU, (n, 3) or more rows, as below
    velocity: Array,
    acceleration: Array,
    yaw_rad: Array,
    law: Packed,
    vehicle: Packed,
    out: Packed,
) -> tuple[float, float, float, float, float]:
    """Fill the target of references by the clock; return its `aim`."""
    rigid, disturbance, limits, target = now[0].rigid, now[0].disturbance, now[0].force, out[0]
    n = target.yaw_rad.shape[0]
    p, v, a, yaw = before_jump((position[:n], velocity[:n], acceleration[:n], yaw_rad[:n]), law[0].interval_s)
    near = (target.position, target.velocity, target.acceleration)
    put(yaw, target.yaw_rad)
    if not law[0].turns:
        go_on_turning(rigid, law[0].interval_s, target.yaw_rad)
    if limits.upright:
        feasible = feasible_part(v, a, disturbance, limits, vehicle)
        approach(rigid[:3], rigid[3:6], (p, v, a), feasible, stopping_s(disturbance, vehicle), law, near)
    else:
        put(p, near[0])
        put(v, near[1])
        put(a, near[2])
    flat = Flat(target.forces, target.attitudes, target.rates, target.squared)
    ask(rigid, near[1], near[2], target.yaw_rad, disturbance, limits, law[0].from_wrench, vehicle, flat)
    put(target.squared[-1], target.end_squared)
    put(demanded_force(rigid, near, disturbance, law, limits, vehicle), target.force)
    return aim(now, out)


@compiled
def aim(now: Packed, target: Packed) -> tuple[float, float, float, float, float]:
    """Return the force's component along body z and its length, N, and the first attitude: phi, theta, psi."""
    rigid, force, attitude = now[0].rigid, target[0].force, target[0].attitudes[0]
    R = rotation_matrix((rigid[6], rigid[7], rigid[8], rigid[9]))
    along_n = force[0] * R[0][2] + force[1] * R[1][2] + force[2] * R[2][2]
    phi, theta = atan2(attitude[2, 1], attitude[2, 2]), -asin(min(max(attitude[2, 0], -1.0), 1.0))
    return along_n, norm(force), phi, theta, target[0].yaw_rad[0]


@compiled
def go_on_turning(rigid: Array, interval_s: float, yaw_rad: Array) -> None:
    """Fill the yaw, (n,), of a vehicle that cannot set it: at its present rate."""
    qw, qx, qy, qz, q, r = rigid[6], rigid[7], rigid[8], rigid[9], rigid[11], rigid[12]
    R = rotation_matrix((qw, qx, qy, qz))
    yaw = atan2(R[1][0], R[0][0])
    per_s = (q * R[2][1] + r * R[2][2]) / max(R[2][1] * R[2][1] + R[2][2] * R[2][2], 0.01)
    for n in range(yaw_rad.shape[0]):
        yaw_rad[n] = yaw + per_s * n * interval_s


@compiled
def ask(
    rigid: Array,  # (13,)
    velocity: Array,  # ENU, (n, 3)
    acceleration: Array,  # ENU, (n, 3)
    yaw_rad: Array,  # (n,)
    disturbance: Disturbance,
    limits: ForceLimits,
    from_wrench: Array,
    packed: Packed,
    out: Flat,
) -> None:
    model = packed[0]
    airframe = model.airframe
    for n in range(yaw_rad.shape[0]):
        for i in range(3):
            out.forces[n, i] = airframe.mass_kg * (acceleration[n, i] - disturbance.acceleration[i])
        out.forces[n, 2] += airframe.mass_kg * airframe.gravity_m_s2
    overcome_drag(velocity, airframe, limits, out.forces)
    if not limits.upright:
        stand_along(rigid, yaw_rad, limits, model.interval_s, out)
    else:
        for n in range(yaw_rad.shape[0]):
            point(out.forces[n], yaw_rad[n], out.attitudes[n])
    turn(out, disturbance.moment, from_wrench, packed)


@compiled
def turn(flat: Flat, disturbance_n_m: Array, from_wrench: Array, packed: Packed) -> None:
    model = packed[0]
    inertia, h = model.inertia, model.interval_s
    steps = flat.rates.shape[0]
    before, after, rate, wrench = np.empty(3), np.empty(3), np.empty(3), np.empty(4)
    momentum = 0.0
    rate_between(flat.attitudes[0], flat.attitudes[1], h, before)
    for n in range(1, steps + 1):
        rate_between(flat.attitudes[n], flat.attitudes[n + 1], h, after)
        for i in range(3):
            rate[i] = flat.rates[n - 1, i] = 0.5 * (before[i] + after[i])
            wrench[1 + i] = inertia[i] * (after[i] - before[i]) / h - disturbance_n_m[i]
        p, q, r = rate
        ix, iy, iz = inertia[0], inertia[1], inertia[2]
        wrench[0] = norm(flat.forces[n])
        wrench[1] -= (iy - iz) * q * r - momentum * q
        wrench[2] -= (iz - ix) * p * r + momentum * p
        wrench[3] -= (ix - iy) * p * q
        momentum = 0.0
        for rotor in range(len(model.momentum)):
            squared = 0.0
            for i in range(4):
                squared += from_wrench[rotor, i] * wrench[i]
            flat.squared[n, rotor] = squared
            momentum += model.momentum[rotor] * sqrt(max(squared, 0.0))
        before, after = after, before
    for rotor in range(len(model.momentum)):
        ahead = flat.squared[1 : min(4, steps + 1), rotor]
        flat.squared[0, rotor] = 3.0 * (ahead[0] - ahead[1]) + ahead[2] if ahead.shape[0] == 3 else ahead[0]


@inlined
def lead(squared: Array, left: float, limits: Array, commands: Array) -> None:
    """Fill the commands, (N, m), within limits, (N, 2), from one of the squared speeds, (N + 1, m), to the next."""
    for n in range(commands.shape[0]):
        for rotor in range(commands.shape[1]):
            command = squared[n, rotor] + (squared[n + 1, rotor] - squared[n, rotor]) / (1.0 - left)
            commands[n, rotor] = min(max(command, limits[n, 0]), limits[n, 1])


@compiled
def point(force: Array, yaw_rad: float, attitude: Array) -> None:
    """Write the attitude, (3, 3), with body z along a force, (3,), at a yaw."""
    s, c = sin(yaw_rad), cos(yaw_rad)
    total = norm(force)
    z0, z1, z2 = force[0] / total, force[1] / total, force[2] / total
    x0, x1, x2 = c * z2, s * z2, -s * z1 - c * z0
    across = sqrt(x0 * x0 + x1 * x1 + x2 * x2)
    x0, x1, x2 = x0 / across, x1 / across, x2 / across
    attitude[0, 0], attitude[1, 0], attitude[2, 0] = x0, x1, x2
    attitude[0, 1], attitude[1, 1], attitude[2, 1] = z1 * x2 - z2 * x1, z2 * x0 - z0 * x2, z0 * x1 - z1 * x0
    attitude[0, 2], attitude[1, 2], attitude[2, 2] = z0, z1, z2


@compiled
def stand_along(rigid: Array, yaw_rad: Array, limits: ForceLimits, interval_s: float, out: Flat) -> None:
    """Write attitudes with body z along the forces, at the yaw where that has a meaning.

    A small force has no useful direction: there the turn goes on. Beyond `HEADING_ABOVE` the attitude turns the
    shortest way, and afterwards returns to the yaw at a limited rate.
    """
    before = np.empty((3, 3))
    R = rotation_matrix((rigid[6], rigid[7], rigid[8], rigid[9]))
    for i in range(3):
        for j in range(3):
            before[i, j] = R[i][j]
    ahead, carried, exact = before[:, 2].copy(), np.empty((3, 3)), True
    for n in range(yaw_rad.shape[0]):
        force, attitude = out.forces[n], out.attitudes[n]
        total = norm(force)
        if total < limits.min_up_n:
            for i in range(3):
                ahead[i] = force[i] + (limits.min_up_n - total) * ahead[i]
            length = max(norm(ahead), LEAST_N)
            total = max(dot(force, ahead) / length, limits.min_n)
            for i in range(3):
                force[i] = total * ahead[i] / length
        steep = force[2] < HEADING_ABOVE * total
        if not steep:
            point(force, yaw_rad[n], attitude)
        if steep or not exact:
            carry(before, force, carried)
            exact = not steep and settle(carried, attitude, _TWIST_RAD_S * interval_s)
            if not exact:
                for i in range(3):
                    put(carried[i], attitude[i])
        along = dot(attitude[:, 2].copy(), before[:, 2].copy())
        for i in range(3):
            ahead[i] = 2.0 * along * attitude[i, 2] - before[i, 2]
        before = attitude


@compiled
def carry(before: Array, force: Array, attitude: Array) -> None:
    """Write the attitude, (3, 3), that turns body z the shortest way to a force, (3,)."""
    total = norm(force)
    z0, z1, z2 = force[0] / total, force[1] / total, force[2] / total
    x, y, z = before[:, 0], before[:, 1], before[:, 2]
    c = z0 * z[0] + z1 * z[1] + z2 * z[2]
    if c < -0.9999:  # half a turn: about body x
        for i in range(3):
            attitude[i, 0], attitude[i, 1], attitude[i, 2] = x[i], -y[i], -z[i]
        return
    for column in range(2):
        b0, b1, b2 = before[0, column], before[1, column], before[2, column]
        part = (z0 * b0 + z1 * b1 + z2 * b2) / (1.0 + c)
        attitude[0, column] = b0 - part * (z[0] + z0)
        attitude[1, column] = b1 - part * (z[1] + z1)
        attitude[2, column] = b2 - part * (z[2] + z2)
    attitude[0, 2], attitude[1, 2], attitude[2, 2] = z0, z1, z2


@compiled
def settle(attitude: Array, wanted: Array, most_rad: float) -> bool:
    """Turn an attitude about its body z towards another of the same z; return whether that is reached."""
    s, c = 0.0, 0.0
    for i in range(3):
        c += attitude[i, 0] * wanted[i, 0]
        s += attitude[i, 1] * wanted[i, 0]
    twist = atan2(s, c)
    if abs(twist) <= most_rad:
        return True
    s, c = sin(most_rad) if twist > 0.0 else -sin(most_rad), cos(most_rad)
    for i in range(3):
        x, y = attitude[i, 0], attitude[i, 1]
        attitude[i, 0], attitude[i, 1] = c * x + s * y, c * y - s * x
    return False


@compiled
def rate_between(before: Array, after: Array, interval_s: float, rate: Array) -> None:
    """Write the body rate, rad/s, FLU, (3,), between two attitudes under 90° apart."""
    squared = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        twice = 0.0
        for row in range(3):
            twice += before[row, k] * after[row, j] - before[row, j] * after[row, k]
        rate[i] = 0.5 * twice
        squared += rate[i] * rate[i]
    stretch = (1.0 + squared * (1.0 / 6.0 + squared * (3.0 / 40.0))) / interval_s
    for i in range(3):
        rate[i] *= stretch


@compiled
def demanded_force(
    rigid: Array, near: tuple[Array, Array, Array], disturbance: Disturbance, packed: Packed, limits: ForceLimits,
    vehicle: Packed,
) -> Array:  # fmt: skip
    """Return the force, N, ENU, (3,), of the recovery's error dynamics about references by `approach`."""
    law, airframe, force = packed[0], vehicle[0].airframe, np.empty(3)
    for i in range(3):
        away, slower = near[0][0, i] - rigid[i], near[1][0, i] - rigid[3 + i]
        demanded = near[2][0, i] + law.recovery_1_s2 * away + law.recovery_1_s * slower
        force[i] = airframe.mass_kg * (demanded - disturbance.acceleration[i])
    force[2] += airframe.mass_kg * airframe.gravity_m_s2
    force[0], force[1], force[2] = limited_force((force[0], force[1], force[2]), limits)
    return force


@compiled
def stand(angles: Array, thrust_n: Array, limits: ForceLimits, out: Flat) -> None:
    for n in range(thrust_n.shape[0]):
        phi, theta, psi = angles[n]
        sf, cf, st, ct, sp, cp = sin(phi), cos(phi), sin(theta), cos(theta), sin(psi), cos(psi)
        R = out.attitudes[n]
        R[0, 0], R[0, 1], R[0, 2] = cp * ct, cp * st * sf - sp * cf, cp * st * cf + sp * sf
        R[1, 0], R[1, 1], R[1, 2] = sp * ct, sp * st * sf + cp * cf, sp * st * cf - cp * sf
        R[2, 0], R[2, 1], R[2, 2] = -st, ct * sf, ct * cf
        thrust = min(max(thrust_n[n], limits.min_n), limits.max_n)
        for i in range(3):
            out.forces[n, i] = thrust * R[i, 2]
