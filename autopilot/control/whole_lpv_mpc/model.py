"""The whole vehicle as its control law models it, and its nominal motion, as compiled kernels.

The nominal motion is a Runge-Kutta rollout of the rigid body under the commands that are expected, from the state now;
`deviations` has what is linear about it. The rotors' squared speeds drive the body. They follow their commands as one
linear lag, so that they are known functions of the commands: see `Lag`. Squared speeds are in parts of the vehicle's
largest.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.vehicle_model.airframe import Airframe, drag_force
from colibri.common.jit import Packed, inlined
from colibri.common.matrices import put
from colibri.common.types import Array

ROTORS = 4
RIGID = 13
"""States of a nominal motion: position and velocity, ENU; quaternion wxyz, FLU to ENU; body rates, FLU."""
_VELOCITY, _QUATERNION, _BODY_RATE = 3, 6, 10
LEAST_SPEED = 1e-3
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


class Drive(NamedTuple):
    """What the rotors do at the beginning, the middle and the end of each step, (3, N).

    Attributes:
        thrust, roll, pitch, yaw: U1, N, and U2, U3, U4, N m.
        momentum, spin_up: Angular momentum along body z, N m s, and its rate, N m.
        halfway: Squared rotor speeds in the middle of each step, (N, 4).
    """

    thrust: Array
    roll: Array
    pitch: Array
    yaw: Array
    momentum: Array
    spin_up: Array
    halfway: Array


def empty_drive(steps: int) -> Drive:
    """Return the arrays of so many steps."""
    return Drive._make([*(np.zeros((3, steps)) for _ in range(6)), np.zeros((steps, ROTORS))])


@inlined
def roll_out(
    rigid: Array,
    squared: Array,
    commands: Array,
    disturbance: Disturbance,
    packed: Packed,
    drive: Drive,
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
        drive: Is filled.
        motion: Is filled with the state now and after each step, (N + 1, 13).
        speeds: Is filled with the squared rotor speeds at the same times, (N + 1, 4).
    """
    model = packed[0]
    lag, h = model.lag, model.interval_s
    put(rigid, motion[0])
    put(squared, speeds[0])
    for step in range(commands.shape[0]):
        for i in range(ROTORS):
            away = speeds[step, i] - commands[step, i]
            drive.halfway[step, i] = commands[step, i] + away * lag.left_half
            speeds[step + 1, i] = commands[step, i] + away * lag.left
    _turn(speeds[1:] if lag.rate_1_s == 0.0 else speeds[:-1], commands, model, 0, drive)
    _turn(drive.halfway, commands, model, 1, drive)
    _turn(speeds[1:], commands, model, 2, drive)
    k1, k2, k3, k4, at = np.empty(RIGID), np.empty(RIGID), np.empty(RIGID), np.empty(RIGID), np.empty(RIGID)
    for step in range(commands.shape[0]):
        x = motion[step]
        _write_rates(x, drive, 0, step, disturbance, model, k1)
        for i in range(RIGID):
            at[i] = x[i] + 0.5 * h * k1[i]
        _write_rates(at, drive, 1, step, disturbance, model, k2)
        for i in range(RIGID):
            at[i] = x[i] + 0.5 * h * k2[i]
        _write_rates(at, drive, 1, step, disturbance, model, k3)
        for i in range(RIGID):
            at[i] = x[i] + h * k3[i]
        _write_rates(at, drive, 2, step, disturbance, model, k4)
        to = motion[step + 1]
        for i in range(RIGID):
            to[i] = x[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])
        q = to[_QUATERNION:_BODY_RATE]
        length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        for i in range(4):
            q[i] /= length


@inlined
def _turn(squared: Array, commands: Array, model: Model, part: int, out: Drive) -> None:
    """Fill what rotors do that turn at `squared` in a part of each step, (N, 4), and are commanded to `commands`."""
    allocation, rate_1_s = model.allocation, model.lag.rate_1_s
    for n in range(commands.shape[0]):
        thrust, roll, pitch, yaw = 0.0, 0.0, 0.0, 0.0
        momentum, spin_up = 0.0, 0.0
        for i in range(ROTORS):
            s = max(squared[n, i], 0.0)
            speed = max(sqrt(s), LEAST_SPEED)
            thrust += allocation[0, i] * s
            roll += allocation[1, i] * s
            pitch += allocation[2, i] * s
            yaw += allocation[3, i] * s
            momentum += model.momentum[i] * speed
            spin_up += model.momentum[i] * 0.5 * (commands[n, i] - s) * rate_1_s / speed
        out.thrust[part, n], out.roll[part, n], out.pitch[part, n], out.yaw[part, n] = thrust, roll, pitch, yaw
        out.momentum[part, n], out.spin_up[part, n] = momentum, spin_up


@inlined
def _write_rates(
    x: Array, drive: Drive, part: int, n: int, disturbance: Disturbance, model: Model, rates: Array
) -> None:
    """Write dx/dt of the rigid body, (13,), in a part of step n."""
    airframe, inertia = model.airframe, model.inertia
    thrust, momentum = drive.thrust[part, n], drive.momentum[part, n]
    qw, qx, qy, qz = x[6], x[7], x[8], x[9]
    p, q, r = x[10], x[11], x[12]
    up = (2.0 * (qx * qz + qw * qy), 2.0 * (qy * qz - qw * qx), 1.0 - 2.0 * (qx * qx + qy * qy))
    drag = drag_force(airframe, (x[3], x[4], x[5]), up, thrust)
    for i in range(3):
        rates[i] = x[_VELOCITY + i]
        rates[_VELOCITY + i] = (thrust * up[i] + drag[i]) / airframe.mass_kg + disturbance.acceleration[i]
    rates[_VELOCITY + 2] -= airframe.gravity_m_s2
    rates[6] = -0.5 * (qx * p + qy * q + qz * r)
    rates[7] = 0.5 * (qw * p + qy * r - qz * q)
    rates[8] = 0.5 * (qw * q + qz * p - qx * r)
    rates[9] = 0.5 * (qw * r + qx * q - qy * p)
    ix, iy, iz = inertia[0], inertia[1], inertia[2]
    rates[10] = (drive.roll[part, n] + disturbance.moment[0] + (iy - iz) * q * r - momentum * q) / ix
    rates[11] = (drive.pitch[part, n] + disturbance.moment[1] + (iz - ix) * p * r + momentum * p) / iy
    rates[12] = (drive.yaw[part, n] + disturbance.moment[2] + (ix - iy) * p * q - drive.spin_up[part, n]) / iz
