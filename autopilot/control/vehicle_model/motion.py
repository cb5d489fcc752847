"""The autopilot's model of the vehicle's motion, x' = f(x), and its integration.

x, 13 + N: position and velocity, ENU; quaternion, FLU to ENU; body rates, FLU; rotor speeds, the vehicle's unit.
Neither wind nor ground is modelled, nor forces across the z axis of tilted rotors.
"""

from math import ceil, sqrt
from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.vehicle_model.battery import loaded_voltage_v
from colibri.common.compiled_rotations import rotation_matrix
from colibri.common.jit import Packed, compiled
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle

RIGID = 13
POSITION, VELOCITY, ATTITUDE, RATE, ROTORS = slice(3), slice(3, 6), slice(6, 10), slice(10, 13), slice(13, None)

_STEP_S = 0.002
_ROUNDING = 1e-6


class MotionModel(NamedTuple):
    """Parameters of a vehicle; zero for effects without a model."""

    mass_kg: float
    gravity_m_s2: float
    inertia: Array  # kg m², (3,)
    allocation: Array  # squared rotor speeds to U1 (N), U2, U3, U4 (N m), (4, N)
    momentum: Array  # of each rotor along body z, signed, N m s per speed unit, (N,)
    arms_m: Array  # forward and left of each rotor, (N, 2)
    drag: Array  # along the FLU axes, N s/m, (3,)
    rotor_drag: float  # of one rotor in its plane, N per m/s and per speed unit
    lag_up_s: float
    lag_down_s: float
    top_speed: float  # at the battery's full voltage
    power_w: Array  # electrical, W per speed unit cubed, (N,)
    full_voltage_v: float  # without load
    resistance_ohm: float


def motion_model(vehicle: Vehicle) -> MotionModel:
    rotors, drag, battery = vehicle.rotors, vehicle.drag, vehicle.battery
    allocation = vehicle.allocation()
    torque = rotors.torque_coefficient * np.array(rotors.strength) * vehicle.rad_s_per_speed_unit
    return MotionModel(
        mass_kg=vehicle.body.mass_kg,
        gravity_m_s2=vehicle.gravity_m_s2,
        inertia=np.array(vehicle.body.inertia_kg_m2),
        allocation=allocation,
        momentum=vehicle.momentum_along_z(),
        arms_m=vehicle.arms_m()[:, :2].copy(),
        drag=np.array(drag.linear_n_s_m if drag else (0.0, 0.0, 0.0)),
        rotor_drag=drag.rotor_coefficient if drag else 0.0,
        lag_up_s=rotors.lag.time_constant_up_s if rotors.lag else 0.0,
        lag_down_s=rotors.lag.time_constant_down_s if rotors.lag else 0.0,
        top_speed=rotors.max_speed,
        power_w=torque / battery.efficiency if battery else np.zeros(rotors.count),
        full_voltage_v=battery.full_voltage_v if battery else 1.0,
        resistance_ohm=battery.resistance_ohm if battery else 0.0,
    )


@compiled
def carry(
    x: Array, durations_s: Array, commands: Array, disturbance: Array, open_voltage_v: float, packed: Packed
) -> Array:
    """Return x after `commands`, rotor speeds in the vehicle's unit, (n, N), by the classical Runge-Kutta rule.

    `disturbance` is acceleration, m/s², ENU, and angular acceleration, rad/s², FLU, (6,).
    """
    x = x.copy()
    k1, k2, k3, k4 = np.empty_like(x), np.empty_like(x), np.empty_like(x), np.empty_like(x)
    y = np.empty_like(x)
    for command in range(durations_s.size):
        steps = max(1, ceil(durations_s[command] / _STEP_S - _ROUNDING))
        h = durations_s[command] / steps
        target = commands[command]
        if packed[0].lag_up_s <= 0.0:
            top = _top_speed(target, open_voltage_v, packed[0])
            for i in range(target.size):
                x[13 + i] = min(target[i], top)
        for _ in range(steps):
            _write_derivative(k1, x, target, disturbance, open_voltage_v, packed[0])
            for k, after, part_s in ((k1, k2, 0.5 * h), (k2, k3, 0.5 * h), (k3, k4, h)):
                for i in range(x.size):
                    y[i] = x[i] + part_s * k[i]
                _write_derivative(after, y, target, disturbance, open_voltage_v, packed[0])
            for i in range(x.size):
                x[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])
    length = sqrt(x[6] * x[6] + x[7] * x[7] + x[8] * x[8] + x[9] * x[9])
    for i in range(6, 10):
        x[i] /= length
    return x


@compiled
def thrust_n(speeds: Array, packed: Packed) -> float:
    thrust = 0.0
    for i in range(speeds.shape[0]):
        thrust += packed[0].allocation[0, i] * speeds[i] * speeds[i]
    return thrust


@compiled
def _write_derivative(
    change: Array, x: Array, target: Array, disturbance: Array, open_voltage_v: float, model: MotionModel
) -> None:
    top = _top_speed(x[13:], open_voltage_v, model)
    h, h_rate, u1, u2, u3, u4 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(model.momentum)):
        speed = x[13 + i]
        way = min(target[i], top) - speed
        lag_s = model.lag_up_s if way > 0.0 else model.lag_down_s
        change[13 + i] = way / lag_s if lag_s > 0.0 else 0.0
        h += model.momentum[i] * speed
        h_rate += model.momentum[i] * change[13 + i]
        squared = speed * speed
        u1 += model.allocation[0, i] * squared
        u2 += model.allocation[1, i] * squared
        u3 += model.allocation[2, i] * squared
        u4 += model.allocation[3, i] * squared
    qw, qx, qy, qz, p, q, r = x[6], x[7], x[8], x[9], x[10], x[11], x[12]
    (a, b, c), (d, e, f), (g, j, k) = rotation_matrix((qw, qx, qy, qz))
    vx, vy, vz = x[3], x[4], x[5]
    u, v, w = a * vx + d * vy + g * vz, b * vx + e * vy + j * vz, c * vx + f * vy + k * vz
    fx, fy, fz = -model.drag[0] * u, -model.drag[1] * v, u1 - model.drag[2] * w
    for i in range(len(model.momentum)):
        drag, ahead_m, left_m = -model.rotor_drag * x[13 + i], model.arms_m[i, 0], model.arms_m[i, 1]
        rotor_fx, rotor_fy = drag * (u - r * left_m), drag * (v + r * ahead_m)
        fx += rotor_fx
        fy += rotor_fy
        u4 += ahead_m * rotor_fy - left_m * rotor_fx
    change[0], change[1], change[2] = vx, vy, vz
    change[3] = (a * fx + b * fy + c * fz) / model.mass_kg + disturbance[0]
    change[4] = (d * fx + e * fy + f * fz) / model.mass_kg + disturbance[1]
    change[5] = (g * fx + j * fy + k * fz) / model.mass_kg - model.gravity_m_s2 + disturbance[2]
    change[6] = -0.5 * (qx * p + qy * q + qz * r)
    change[7] = 0.5 * (qw * p + qy * r - qz * q)
    change[8] = 0.5 * (qw * q + qz * p - qx * r)
    change[9] = 0.5 * (qw * r + qx * q - qy * p)
    ix, iy, iz = model.inertia[0], model.inertia[1], model.inertia[2]
    change[10] = (q * r * (iy - iz) - q * h + u2) / ix + disturbance[3]
    change[11] = (p * r * (iz - ix) + p * h + u3) / iy + disturbance[4]
    change[12] = (p * q * (ix - iy) + u4 - h_rate) / iz + disturbance[5]


@compiled
def _top_speed(speeds: Array, open_voltage_v: float, model: MotionModel) -> float:
    power_w = 0.0
    for i in range(len(model.momentum)):
        power_w += model.power_w[i] * speeds[i] * speeds[i] * speeds[i]
    voltage_v = loaded_voltage_v(open_voltage_v, power_w, model.resistance_ohm)
    return model.top_speed * (voltage_v / model.full_voltage_v)
