"""The vehicle's equations of motion, x' = f(x), as one compiled kernel.

x has 14 + N values: the rigid body's `STATE`, N rotor speeds in the vehicle's unit, and the charge used, Ah. Velocity
m/s and rates rad/s are FLU, position m is ENU; the unit quaternion turns FLU into ENU.

Rotors that all thrust along z in the plane of the centre of mass, on a body with a diagonal inertia matrix, have
shorter equations, chosen at compile time by the shapes of the parameters.
"""

from collections.abc import Sequence
from math import inf, isfinite, sqrt
from typing import NamedTuple

import numpy as np

from colibri.common.compiled_rotations import rotation_matrix
from colibri.common.jit import Packed, compiled
from colibri.common.matrices import put
from colibri.common.types import Array, Matrix, PerRotor, Quaternion, Vector

STATE = ("u", "v", "w", "p", "q", "r", "x", "y", "z", "qw", "qx", "qy", "qz")
ROTORS = slice(13, -1)
CHARGE = -1

_AH_PER_C = 1.0 / 3600.0
_HALVINGS = 60


class PlantParameters(NamedTuple):
    """Numbers of a vehicle and of the air around it; the defaults switch an effect off. Kernels take them `packed`."""

    mass_kg: float
    gravity_m_s2: float
    inertia_kg_m2: Vector
    thrust: PerRotor  # N per speed unit squared
    yaw_moment: PerRotor  # about the rotor's axis, N m per speed unit squared, with its sign
    momentum: PerRotor  # angular momentum along the rotor's axis, N m s per speed unit, with its sign
    rotor_x_m: PerRotor  # forward
    rotor_y_m: PerRotor  # left
    power: PerRotor  # electrical, W per speed unit cubed; 0 without a battery
    top_speed: float  # at the battery's full voltage
    wind_enu_m_s: Vector
    lag_up_s: float = inf  # time constant; inf: the rotors follow at once
    lag_down_s: float = inf
    linear_drag_n_s_m: Vector = (0.0, 0.0, 0.0)  # of the airframe, along the FLU axes
    quadratic_drag_n_s2_m2: Vector = (0.0, 0.0, 0.0)  # of the airframe, along the FLU axes
    rotor_drag: float = 0.0  # in its plane, N per m/s and per speed unit
    full_voltage_v: float = 1.0  # open-circuit
    empty_voltage_v: float = 1.0  # open-circuit
    resistance_ohm: float = 0.0
    capacity_ah: float = inf
    contacts_m: Array = np.zeros((0, 3))  # points in FLU that can touch the ground
    ground_m: float = -inf  # z of ENU; -inf: no ground
    stiffness_n_m: float = 0.0  # of the ground at one point
    damping_n_s_m: float = 0.0  # against sinking in and coming out
    friction: float = 0.0
    slip_damping_n_s_m: float = 0.0  # friction of a creeping point, below Coulomb's limit
    noise_n: Vector = (0.0, 0.0, 0.0)  # random force on the body, FLU
    noise_n_m: Vector = (0.0, 0.0, 0.0)  # random moment on the body, FLU
    axes: Array = np.zeros((0, 4))  # of the thrusts, FLU, and z of the rotors, m, (N, 4); (0, 4) for short equations
    inertia: Array = np.zeros((0, 3, 3))  # the matrix and its inverse, kg m², (2, 3, 3)


class Wrench(NamedTuple):
    """Force and moment on the body at its centre of mass, FLU."""

    force_n: Vector
    moment_n_m: Vector


@compiled
def rotor_wrench(speeds: Array | PerRotor, parameters: PlantParameters) -> Wrench:
    """Return force (0, 0, U1) and moment (U2, U3, U4) of the rotors, THESIS [2.2]."""
    if parameters.axes.shape[0] > 0:
        return _wrench_in_space(speeds, parameters)
    u1, u2, u3, u4 = 0.0, 0.0, 0.0, 0.0
    for i in range(len(parameters.thrust)):
        squared = speeds[i] * speeds[i]
        thrust_n = parameters.thrust[i] * squared
        u1 += thrust_n
        u2 += thrust_n * parameters.rotor_y_m[i]
        u3 -= thrust_n * parameters.rotor_x_m[i]
        u4 += parameters.yaw_moment[i] * squared
    return Wrench((0.0, 0.0, u1), (u2, u3, u4))


@compiled
def _wrench_in_space(speeds: Array | PerRotor, parameters: PlantParameters) -> Wrench:
    fx, fy, fz, mx, my, mz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(parameters.thrust)):
        x, y, z = parameters.rotor_x_m[i], parameters.rotor_y_m[i], parameters.axes[i, 3]
        thrust_n = parameters.thrust[i] * speeds[i] * speeds[i]
        drag_n_m = parameters.yaw_moment[i] * speeds[i] * speeds[i]
        ax, ay, az = parameters.axes[i, 0], parameters.axes[i, 1], parameters.axes[i, 2]
        fx, fy, fz = fx + thrust_n * ax, fy + thrust_n * ay, fz + thrust_n * az
        mx += thrust_n * (y * az - z * ay) + drag_n_m * ax
        my += thrust_n * (z * ax - x * az) + drag_n_m * ay
        mz += thrust_n * (x * ay - y * ax) + drag_n_m * az
    return Wrench((fx, fy, fz), (mx, my, mz))


@compiled
def rotor_momentum(speeds: Array | PerRotor, parameters: PlantParameters) -> float:
    """Return the angular momentum h along body z, N m s; h = -J Ω in the thesis's symbols (erratum 2)."""
    total: float = parameters.momentum[0] * speeds[0]
    for i in range(1, len(parameters.momentum)):
        total += parameters.momentum[i] * speeds[i]
    return total


@compiled
def _momentum_in_space(speeds: Array | PerRotor, parameters: PlantParameters) -> Vector:
    x, y, z = 0.0, 0.0, 0.0
    for i in range(len(parameters.momentum)):
        momentum = parameters.momentum[i] * speeds[i]
        x, y = x + momentum * parameters.axes[i, 0], y + momentum * parameters.axes[i, 1]
        z += momentum * parameters.axes[i, 2]
    return x, y, z


@compiled
def _turn_in_space(rate: Vector, moment: Vector, h: Vector, h_rate: Vector, inertia: Array) -> Vector:
    """Return I⁻¹ (τ - h' - ω × (I ω + h)); `inertia` has I and its inverse, (2, 3, 3)."""
    p, q, r = rate
    lx = inertia[0, 0, 0] * p + inertia[0, 0, 1] * q + inertia[0, 0, 2] * r + h[0]
    ly = inertia[0, 1, 0] * p + inertia[0, 1, 1] * q + inertia[0, 1, 2] * r + h[1]
    lz = inertia[0, 2, 0] * p + inertia[0, 2, 1] * q + inertia[0, 2, 2] * r + h[2]
    mx = moment[0] - h_rate[0] - (q * lz - r * ly)
    my = moment[1] - h_rate[1] - (r * lx - p * lz)
    mz = moment[2] - h_rate[2] - (p * ly - q * lx)
    return (
        inertia[1, 0, 0] * mx + inertia[1, 0, 1] * my + inertia[1, 0, 2] * mz,
        inertia[1, 1, 0] * mx + inertia[1, 1, 1] * my + inertia[1, 1, 2] * mz,
        inertia[1, 2, 0] * mx + inertia[1, 2, 1] * my + inertia[1, 2, 2] * mz,
    )


@compiled
def angular_acceleration(rate: Vector, moment: Vector, h: float, h_rate: float, inertia: Vector) -> Vector:
    """Return (p', q', r') by Euler's equation with rotors, THESIS [2.8].

    I ω' + (0, 0, h') = -ω × (I ω + (0, 0, h)) + τ.
    """
    p, q, r = rate
    ix, iy, iz = inertia[0], inertia[1], inertia[2]
    return (
        (q * r * (iy - iz) - q * h + moment[0]) / ix,
        (p * r * (iz - ix) + p * h + moment[1]) / iy,
        (p * q * (ix - iy) + moment[2] - h_rate) / iz,
    )


@compiled
def drag_wrench(air: Vector, rate: Vector, speeds: Array | PerRotor, parameters: PlantParameters) -> Wrench:
    """Return the drag of airframe and rotors; `air` is the velocity through the air, FLU.

    The airframe's is -(l + q |v|) v along each axis, a rotor's -c Ω (v + ω × r) in its plane: Faessler, Franchi,
    Scaramuzza (RA-L 2018), RotorS.
    """
    if parameters.axes.shape[0] > 0:
        return _drag_in_space(air, rate, speeds, parameters)
    linear, quadratic = parameters.linear_drag_n_s_m, parameters.quadratic_drag_n_s2_m2
    speed = sqrt(air[0] * air[0] + air[1] * air[1] + air[2] * air[2])
    fx, fy = -(linear[0] + quadratic[0] * speed) * air[0], -(linear[1] + quadratic[1] * speed) * air[1]
    fz, yaw = -(linear[2] + quadratic[2] * speed) * air[2], 0.0
    for i in range(len(parameters.thrust)):
        x, y = parameters.rotor_x_m[i], parameters.rotor_y_m[i]
        drag = -parameters.rotor_drag * speeds[i]
        rotor_fx, rotor_fy = drag * (air[0] - rate[2] * y), drag * (air[1] + rate[2] * x)
        fx += rotor_fx
        fy += rotor_fy
        yaw += x * rotor_fy - y * rotor_fx
    return Wrench((fx, fy, fz), (0.0, 0.0, yaw))


@compiled
def _drag_in_space(air: Vector, rate: Vector, speeds: Array | PerRotor, parameters: PlantParameters) -> Wrench:
    linear, quadratic = parameters.linear_drag_n_s_m, parameters.quadratic_drag_n_s2_m2
    speed = sqrt(air[0] * air[0] + air[1] * air[1] + air[2] * air[2])
    fx, fy = -(linear[0] + quadratic[0] * speed) * air[0], -(linear[1] + quadratic[1] * speed) * air[1]
    fz, mx, my, mz = -(linear[2] + quadratic[2] * speed) * air[2], 0.0, 0.0, 0.0
    for i in range(len(parameters.thrust)):
        x, y, z = parameters.rotor_x_m[i], parameters.rotor_y_m[i], parameters.axes[i, 3]
        ax, ay, az = parameters.axes[i, 0], parameters.axes[i, 1], parameters.axes[i, 2]
        u = air[0] + rate[1] * z - rate[2] * y
        v = air[1] + rate[2] * x - rate[0] * z
        w = air[2] + rate[0] * y - rate[1] * x
        along, drag = u * ax + v * ay + w * az, -parameters.rotor_drag * speeds[i]
        gx, gy, gz = drag * (u - along * ax), drag * (v - along * ay), drag * (w - along * az)
        fx, fy, fz = fx + gx, fy + gy, fz + gz
        mx, my, mz = mx + y * gz - z * gy, my + z * gx - x * gz, mz + x * gy - y * gx
    return Wrench((fx, fy, fz), (mx, my, mz))


@compiled
def contact_wrench(height_m: float, velocity: Vector, rate: Vector, R: Matrix, parameters: PlantParameters) -> Wrench:
    """Return the ground's wrench: at each point below it a spring and a damper that only push, and friction.

    Friction is Coulomb's up to a stiffness of `slip_damping_n_s_m`: points creep, which keeps the equations smooth.
    `velocity` is FLU.
    """
    fx, fy, fz, mx, my, mz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    p, q, r = rate
    contacts_m = parameters.contacts_m
    for i in range(contacts_m.shape[0]):
        x, y, z = contacts_m[i, 0], contacts_m[i, 1], contacts_m[i, 2]
        depth_m = parameters.ground_m - height_m - (R[2][0] * x + R[2][1] * y + R[2][2] * z)
        if depth_m <= 0.0:
            continue
        slip = _rotated(R, (velocity[0] + q * z - r * y, velocity[1] + r * x - p * z, velocity[2] + p * y - q * x))
        normal_n = max(0.0, parameters.stiffness_n_m * depth_m - parameters.damping_n_s_m * slip[2])
        slip_m_s = sqrt(slip[0] * slip[0] + slip[1] * slip[1])
        grip = parameters.slip_damping_n_s_m
        if grip * slip_m_s > parameters.friction * normal_n:
            grip = parameters.friction * normal_n / slip_m_s
        gx, gy, gz = _rotated_back(R, (-grip * slip[0], -grip * slip[1], normal_n))
        fx, fy, fz = fx + gx, fy + gy, fz + gz
        mx, my, mz = mx + y * gz - z * gy, my + z * gx - x * gz, mz + x * gy - y * gx
    return Wrench((fx, fy, fz), (mx, my, mz))


@compiled
def battery(speeds: Array | PerRotor, charge_ah: float, parameters: PlantParameters) -> tuple[float, float]:
    """Return terminal voltage, V, and current, A, by V² - V0 V + R P = 0; at most V0² / 4R can be drawn."""
    power_w = 0.0
    for i in range(len(parameters.power)):
        power_w += parameters.power[i] * speeds[i] * speeds[i] * speeds[i]
    used = min(1.0, charge_ah / parameters.capacity_ah)
    open_v = parameters.full_voltage_v + (parameters.empty_voltage_v - parameters.full_voltage_v) * used
    power_w = min(power_w, open_v * open_v / (4.0 * parameters.resistance_ohm))
    voltage_v = 0.5 * (open_v + sqrt(max(0.0, open_v * open_v - 4.0 * parameters.resistance_ohm * power_w)))
    return voltage_v, power_w / voltage_v


@compiled
def specific_force(x: Array, parameters: Packed) -> Vector:
    numbers = parameters[0]
    R = rotation_matrix((x[9], x[10], x[11], x[12]))
    fx, fy, fz = _wrench(x, R, x[ROTORS], numbers).force_n
    return (fx / numbers.mass_kg, fy / numbers.mass_kg, fz / numbers.mass_kg)


@compiled
def hold(start: Array, target: PerRotor, parameters: Packed, x: Array) -> None:
    """Write x at the start of a command: rotors without lag turn at once as fast as the battery allows."""
    put(start, x)
    numbers = parameters[0]
    if numbers.lag_up_s == np.inf:
        share = _share_held(target, x[CHARGE], numbers)
        for i in range(len(target)):
            x[13 + i] = min(target[i], share * numbers.top_speed)


@compiled
def close(x: Array, parameters: Packed) -> float:
    """Clip rotor speeds in place after rounding; return the battery's voltage."""
    for i in range(13, 13 + len(parameters[0].thrust)):
        x[i] = min(max(x[i], 0.0), parameters[0].top_speed)
    return battery(x[ROTORS], x[CHARGE], parameters[0])[0]


@compiled
def close_attitude(x: Array) -> bool:
    """Normalise the quaternion of x in place; return whether all of x is finite."""
    qw, qx, qy, qz = x[9], x[10], x[11], x[12]
    norm = sqrt(qw * qw + qx * qx + qy * qy + qz * qz)
    for i in range(9, 13):
        x[i] /= norm
    is_finite = True
    for i in range(x.size):
        is_finite &= isfinite(x[i])
    return is_finite


def attitude_of(state: Sequence[float]) -> Quaternion:
    qw, qx, qy, qz = state[9:13]
    return (qw, qx, qy, qz)


@compiled
def write_derivative(change: Array, x: Array, target: PerRotor, parameters: PlantParameters) -> None:
    speeds, speed_rates = x[ROTORS], change[ROTORS]
    voltage_v, current_a = battery(speeds, x[CHARGE], parameters)
    maximum = parameters.top_speed * (voltage_v / parameters.full_voltage_v)
    for i in range(len(target)):
        speed_rates[i] = _lag(speeds[i], min(target[i], maximum), parameters)
    change[CHARGE] = current_a * _AH_PER_C
    R = rotation_matrix((x[9], x[10], x[11], x[12]))
    wrench = _wrench(x, R, speeds, parameters)
    _write_motion(change, x, R, wrench, parameters)
    rate = (x[3], x[4], x[5])
    if parameters.axes.shape[0] > 0:
        momentum, turning = _momentum_in_space(speeds, parameters), _momentum_in_space(speed_rates, parameters)
        change[3], change[4], change[5] = _turn_in_space(rate, wrench.moment_n_m, momentum, turning, parameters.inertia)
        return
    h, h_rate = rotor_momentum(speeds, parameters), rotor_momentum(speed_rates, parameters)
    change[3], change[4], change[5] = angular_acceleration(rate, wrench.moment_n_m, h, h_rate, parameters.inertia_kg_m2)


@compiled
def _wrench(x: Array, R: Matrix, speeds: Array | PerRotor, parameters: PlantParameters) -> Wrench:
    velocity, rate = (x[0], x[1], x[2]), (x[3], x[4], x[5])
    wind = _rotated_back(R, parameters.wind_enu_m_s)
    rotors = rotor_wrench(speeds, parameters)
    drag = drag_wrench(_sum(velocity, (-wind[0], -wind[1], -wind[2])), rate, speeds, parameters)
    ground = contact_wrench(x[8], velocity, rate, R, parameters)
    force_n = _sum(rotors.force_n, _sum(drag.force_n, _sum(ground.force_n, parameters.noise_n)))
    moment_n_m = _sum(drag.moment_n_m, _sum(ground.moment_n_m, parameters.noise_n_m))
    return Wrench(force_n, _sum(rotors.moment_n_m, moment_n_m))


@compiled
def _write_motion(change: Array, x: Array, R: Matrix, wrench: Wrench, parameters: PlantParameters) -> None:
    u, v, w, p, q, r = x[0], x[1], x[2], x[3], x[4], x[5]
    qw, qx, qy, qz = x[9], x[10], x[11], x[12]
    fx, fy, fz = wrench.force_n
    g, mass_kg = parameters.gravity_m_s2, parameters.mass_kg
    change[0] = v * r - w * q - g * R[2][0] + fx / mass_kg
    change[1] = w * p - u * r - g * R[2][1] + fy / mass_kg
    change[2] = u * q - v * p - g * R[2][2] + fz / mass_kg
    change[6], change[7], change[8] = _rotated(R, (u, v, w))
    change[9] = -0.5 * (qx * p + qy * q + qz * r)
    change[10] = 0.5 * (qw * p + qy * r - qz * q)
    change[11] = 0.5 * (qw * q + qz * p - qx * r)
    change[12] = 0.5 * (qw * r + qx * q - qy * p)


@compiled
def _lag(speed: float, target: float, parameters: PlantParameters) -> float:
    return (target - speed) / (parameters.lag_up_s if target > speed else parameters.lag_down_s)


@compiled
def _share_held(target: PerRotor, charge_ah: float, parameters: PlantParameters) -> float:
    """Return the share of the top speed at which rotors that follow `target` leave just the voltage for it."""
    low, high = 0.0, 1.0
    if _voltage_share(target, high, charge_ah, parameters) >= high:
        return high
    for _ in range(_HALVINGS):
        share = 0.5 * (low + high)
        if _voltage_share(target, share, charge_ah, parameters) > share:
            low = share
        else:
            high = share
    return low


@compiled
def _voltage_share(target: PerRotor, share: float, charge_ah: float, parameters: PlantParameters) -> float:
    maximum, speeds = share * parameters.top_speed, np.empty(len(target))
    for i in range(len(target)):
        speeds[i] = min(target[i], maximum)
    return battery(speeds, charge_ah, parameters)[0] / parameters.full_voltage_v


@compiled
def _sum(a: Vector, b: Vector) -> Vector:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@compiled
def _rotated(R: Matrix, v: Vector) -> Vector:
    return (
        R[0][0] * v[0] + R[0][1] * v[1] + R[0][2] * v[2],
        R[1][0] * v[0] + R[1][1] * v[1] + R[1][2] * v[2],
        R[2][0] * v[0] + R[2][1] * v[1] + R[2][2] * v[2],
    )


@compiled
def _rotated_back(R: Matrix, v: Vector) -> Vector:
    return (
        R[0][0] * v[0] + R[1][0] * v[1] + R[2][0] * v[2],
        R[0][1] * v[0] + R[1][1] * v[1] + R[2][1] * v[2],
        R[0][2] * v[0] + R[1][2] * v[1] + R[2][2] * v[2],
    )
