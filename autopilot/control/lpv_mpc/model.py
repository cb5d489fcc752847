"""The vehicle's model and its nominal motion, as compiled kernels.

The motion is a Runge-Kutta rollout of the rigid body with the expected commands. Squared rotor speeds, in parts of the
largest, follow their commands as one linear lag. m is the number of rotors.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.vehicle_model.airframe import Airframe, drag_force
from colibri.common.jit import Packed, inlined
from colibri.common.matrices import put
from colibri.common.types import Array

RIGID = 13  # position and velocity, ENU; quaternion wxyz, FLU to ENU; body rates, FLU
_VELOCITY, _QUATERNION, _BODY_RATE = 3, 6, 10
LEAST_SPEED = 1e-3  # of a rotor as a divisor


class Lag(NamedTuple):
    """Lag of squared rotor speeds over a step h: ds/dt = (u - s) / τ."""

    left: float  # exp(-h / τ), the part of u - s left after a step; 0 without lag
    left_half: float  # after half a step
    left_mean: float  # mean over the step
    rate_1_s: float  # 1 / τ; 0 without lag


class Model(NamedTuple):
    """Parameters of a vehicle."""

    airframe: Airframe
    inertia: Array  # kg m², (3,)
    allocation: Array  # squared speeds to U1, N, and U2, U3, U4, N m, (4, m)
    momentum: Array  # of each rotor along body z at its largest speed, N m s, (m,)
    lag: Lag
    interval_s: float


class Disturbance(NamedTuple):
    """Observed disturbance, constant over the horizon."""

    acceleration: Array  # m/s², ENU, (3,)
    moment: Array  # N m, FLU, (3,)


class Drive(NamedTuple):
    """Effects of the rotors at the beginning, middle and end of each step, (3, N)."""

    thrust: Array  # U1, N
    roll: Array  # N m
    pitch: Array  # N m
    yaw: Array  # N m
    momentum: Array  # along body z, N m s
    spin_up: Array  # its rate, N m
    halfway: Array  # squared rotor speeds in the middle of each step, (N, m)


def empty_drive(steps: int, rotors: int) -> Drive:
    return Drive._make([*(np.zeros((3, steps)) for _ in range(6)), np.zeros((steps, rotors))])


@inlined
def roll_out(
    rigid: Array,  # (13,)
    squared: Array,  # rotor speeds, (m,)
    commands: Array,  # (N, m)
    disturbance: Disturbance,
    packed: Packed,
    drive: Drive,
    motion: Array,  # from now on, (N + 1, 13)
    speeds: Array,  # squared, from now on, (N + 1, m)
) -> None:
    model = packed[0]
    lag, h = model.lag, model.interval_s
    put(rigid, motion[0])
    put(squared, speeds[0])
    for step in range(commands.shape[0]):
        for i in range(len(model.momentum)):
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
    allocation, rate_1_s = model.allocation, model.lag.rate_1_s
    for n in range(commands.shape[0]):
        thrust, roll, pitch, yaw = 0.0, 0.0, 0.0, 0.0
        momentum, spin_up = 0.0, 0.0
        for i in range(len(model.momentum)):
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
