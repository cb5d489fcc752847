"""The vehicle's equations of motion, x' = f(x), as one compiled kernel.

x is the rigid body's `STATE`, then the four rotor speeds in the vehicle's unit, then the charge taken from the battery
in Ah: 18 values. The attitude is a quaternion, so that no attitude is singular: body velocity m/s and body rates rad/s
in FLU, position m in ENU, and the unit quaternion that turns FLU into ENU.
"""

from collections.abc import Sequence
from math import inf, isfinite, sqrt
from typing import NamedTuple

import numpy as np

from colibri.common.compiled_rotations import rotation_matrix
from colibri.common.jit import Packed, compiled
from colibri.common.matrices import put
from colibri.common.types import Array, FourRotors, Matrix, Quaternion, Vector

STATE = ("u", "v", "w", "p", "q", "r", "x", "y", "z", "qw", "qx", "qy", "qz")
ROTORS = slice(13, 17)
CHARGE = 17

_AH_PER_C = 1.0 / 3600.0
_HALVINGS = 60


class Parameters(NamedTuple):
    """The numbers of a vehicle and of the air around it. What is not modelled has the defaults, which leave no trace.

    A kernel sees them as a record of the same fields: see `packed`.

    Attributes:
        gravity_m_s2: Gravitational acceleration, towards -z of ENU.
        thrust: Of each rotor along body z, N per speed unit squared.
        yaw_moment: Of each rotor about body z, with its sign, N m per speed unit squared.
        momentum: Angular momentum of each rotor along body z, with its sign, N m s per speed unit.
        rotor_x_m, rotor_y_m: Forward and left of each rotor.
        top_speed: Of a rotor, at the battery's full voltage.
        lag_up_s, lag_down_s: Time constants of rotors that speed up and slow down; infinite where they follow at once.
        linear_drag_n_s_m: Of the airframe, along the FLU axes.
        rotor_drag: Of one rotor in its plane, N per m/s and per speed unit.
        power: Electrical power of each rotor, W per speed unit cubed.
        full_voltage_v, empty_voltage_v: Open-circuit voltage of the full and of the empty battery.
        capacity_ah: The charge that empties it.
        contacts_m: Points in FLU that the ground can touch, (8, 3).
        ground_m: Height of the ground, z of ENU; -inf for none.
        stiffness_n_m, damping_n_s_m: Of the ground at one point; the damping is against sinking in and coming out.
        slip_damping_n_s_m: Friction of one point that creeps, before Coulomb's limit: N for each m/s.
    """

    mass_kg: float
    gravity_m_s2: float
    inertia_kg_m2: Vector
    thrust: FourRotors
    yaw_moment: FourRotors
    momentum: FourRotors
    rotor_x_m: FourRotors
    rotor_y_m: FourRotors
    top_speed: float
    wind_enu_m_s: Vector
    lag_up_s: float = inf
    lag_down_s: float = inf
    linear_drag_n_s_m: Vector = (0.0, 0.0, 0.0)
    rotor_drag: float = 0.0
    power: FourRotors = (0.0, 0.0, 0.0, 0.0)
    full_voltage_v: float = 1.0
    empty_voltage_v: float = 1.0
    resistance_ohm: float = 0.0
    capacity_ah: float = inf
    contacts_m: Array = np.zeros((8, 3))
    ground_m: float = -inf
    stiffness_n_m: float = 0.0
    damping_n_s_m: float = 0.0
    friction: float = 0.0
    slip_damping_n_s_m: float = 0.0


class Wrench(NamedTuple):
    """What acts on the body at its centre of mass, in FLU."""

    force_n: Vector
    moment_n_m: Vector


@compiled
def rotor_wrench(speeds: FourRotors, parameters: Parameters) -> Wrench:
    """Return thrust and moments of the rotors, THESIS [2.2]: force (0, 0, U1), moment (U2, U3, U4)."""
    u1, u2, u3, u4 = 0.0, 0.0, 0.0, 0.0
    for i in range(4):
        squared = speeds[i] * speeds[i]
        thrust_n = parameters.thrust[i] * squared
        u1 += thrust_n
        u2 += thrust_n * parameters.rotor_y_m[i]
        u3 -= thrust_n * parameters.rotor_x_m[i]
        u4 += parameters.yaw_moment[i] * squared
    return Wrench((0.0, 0.0, u1), (u2, u3, u4))


@compiled
def rotor_momentum(speeds: FourRotors, parameters: Parameters) -> float:
    """Return the angular momentum h of the rotors along body z, N m s. With THESIS's Ω and J, h = -J Ω (erratum 2)."""
    h = parameters.momentum
    return h[0] * speeds[0] + h[1] * speeds[1] + h[2] * speeds[2] + h[3] * speeds[3]


@compiled
def angular_acceleration(rate: Vector, moment: Vector, h: float, h_rate: float, inertia: Vector) -> Vector:
    """Return (p', q', r') by Euler's equation with rotors, THESIS [2.8].

    I ω' + (0, 0, h') = -ω × (I ω + (0, 0, h)) + τ. The gyroscopic moment -ω × (0, 0, h) = (-q h, p h, 0) does no work.

    Args:
        rate: p, q, r in FLU, rad/s.
        moment: τ in FLU, N m.
        h: Angular momentum of the rotors along body z, N m s.
        h_rate: Its rate of change, N m: what spins the rotors up turns the body back.
        inertia: Ix, Iy, Iz, kg m².
    """
    p, q, r = rate
    ix, iy, iz = inertia[0], inertia[1], inertia[2]
    return (
        (q * r * (iy - iz) - q * h + moment[0]) / ix,
        (p * r * (iz - ix) + p * h + moment[1]) / iy,
        (p * q * (ix - iy) + moment[2] - h_rate) / iz,
    )


@compiled
def drag_wrench(air: Vector, rate: Vector, speeds: FourRotors, parameters: Parameters) -> Wrench:
    """Return the drag of airframe and rotors.

    The airframe's is linear in its airspeed. A rotor's is proportional to its speed and to its own airspeed in its
    plane, -c Ω (v + ω × r), as in Faessler, Franchi and Scaramuzza (RA-L 2018) and RotorS.

    Args:
        air: Velocity of the centre of mass through the air, FLU, m/s.
        rate: p, q, r in FLU, rad/s.
        speeds: Rotor speeds, the vehicle's unit.
        parameters: The vehicle's.
    """
    linear = parameters.linear_drag_n_s_m
    fx, fy, fz, yaw = -linear[0] * air[0], -linear[1] * air[1], -linear[2] * air[2], 0.0
    for i in range(4):
        x, y = parameters.rotor_x_m[i], parameters.rotor_y_m[i]
        drag = -parameters.rotor_drag * speeds[i]
        rotor_fx, rotor_fy = drag * (air[0] - rate[2] * y), drag * (air[1] + rate[2] * x)
        fx += rotor_fx
        fy += rotor_fy
        yaw += x * rotor_fy - y * rotor_fx
    return Wrench((fx, fy, fz), (0.0, 0.0, yaw))


@compiled
def contact_wrench(height_m: float, velocity: Vector, rate: Vector, R: Matrix, parameters: Parameters) -> Wrench:
    """Return what the ground does: at each point below it a spring and a damper that only push, and friction.

    Friction is Coulomb's, μ N against the slip, but never stiffer than `slip_damping_n_s_m`: a point that stands
    creeps instead of sticking, and the equations stay as smooth for a hard landing as for a soft one.

    Args:
        height_m: z of ENU of the centre of mass.
        velocity: Of the centre of mass, FLU, m/s.
        rate: p, q, r in FLU, rad/s.
        R: FLU to ENU.
        parameters: The vehicle's.
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
def battery(speeds: FourRotors, charge_ah: float, parameters: Parameters) -> tuple[float, float]:
    """Return the battery's terminal voltage, V, and its current, A.

    The open-circuit voltage falls linearly with the charge taken, and no further once it is empty. Power P at terminal
    voltage V = V0 - R I: V² - V0 V + R P = 0. No more than V0² / 4R can be drawn, at half the open-circuit voltage.
    """
    power_w = 0.0
    for i in range(4):
        power_w += parameters.power[i] * speeds[i] * speeds[i] * speeds[i]
    used = min(1.0, charge_ah / parameters.capacity_ah)
    open_v = parameters.full_voltage_v + (parameters.empty_voltage_v - parameters.full_voltage_v) * used
    power_w = min(power_w, open_v * open_v / (4.0 * parameters.resistance_ohm))
    voltage_v = 0.5 * (open_v + sqrt(max(0.0, open_v * open_v - 4.0 * parameters.resistance_ohm * power_w)))
    return voltage_v, power_w / voltage_v


@compiled
def derivative(x: Array, target: FourRotors, parameters: Packed) -> Array:
    """Return x' = f(x), (18,), while the rotors are commanded to the speeds `target`, the vehicle's unit."""
    change = np.empty_like(x)
    write_derivative(change, x, target, parameters[0])
    return change


@compiled
def specific_force(x: Array, parameters: Packed) -> Vector:
    """Return what an accelerometer at the centre of mass feels, m/s² in FLU: acceleration without gravity."""
    numbers = parameters[0]
    R = rotation_matrix((x[9], x[10], x[11], x[12]))
    fx, fy, fz = _wrench(x, R, (x[13], x[14], x[15], x[16]), numbers).force_n
    return (fx / numbers.mass_kg, fy / numbers.mass_kg, fz / numbers.mass_kg)


@compiled
def hold(start: Array, target: FourRotors, parameters: Packed, x: Array) -> None:
    """Write x as a command finds it, (18,): rotors without lag turn at once at what the battery can hold."""
    put(start, x)
    numbers = parameters[0]
    if numbers.lag_up_s == np.inf:
        share = _share_held(target, x[17], numbers)
        for i in range(4):
            x[13 + i] = min(target[i], share * numbers.top_speed)


@compiled
def close(x: Array, parameters: Packed) -> float:
    """Put rotor speeds that rounding carried past their limits back on them, in place; return the battery's voltage."""
    for i in range(13, 17):
        x[i] = min(max(x[i], 0.0), parameters[0].top_speed)
    return battery((x[13], x[14], x[15], x[16]), x[17], parameters[0])[0]


@compiled
def close_attitude(x: Array) -> bool:
    """Scale the attitude of x, (18,), to unit length, in place; return whether all of x is finite."""
    qw, qx, qy, qz = x[9], x[10], x[11], x[12]
    norm = sqrt(qw * qw + qx * qx + qy * qy + qz * qz)
    for i in range(9, 13):
        x[i] /= norm
    is_finite = True
    for i in range(x.size):
        is_finite &= isfinite(x[i])
    return is_finite


def attitude_of(state: Sequence[float]) -> Quaternion:
    """Return the attitude quaternion of a state."""
    qw, qx, qy, qz = state[9:13]
    return (qw, qx, qy, qz)


@compiled
def write_derivative(change: Array, x: Array, target: FourRotors, parameters: Parameters) -> None:
    """Write `derivative` to `change`, (18,); the parameters are a record of `packed`."""
    speeds = (x[13], x[14], x[15], x[16])
    voltage_v, current_a = battery(speeds, x[17], parameters)
    speed_rates = _speed_rates(speeds, target, voltage_v, parameters)
    change[13], change[14], change[15], change[16] = speed_rates
    change[17] = current_a * _AH_PER_C
    R = rotation_matrix((x[9], x[10], x[11], x[12]))
    wrench = _wrench(x, R, speeds, parameters)
    _write_motion(change, x, R, wrench, parameters)
    h, h_rate = rotor_momentum(speeds, parameters), rotor_momentum(speed_rates, parameters)
    rate = (x[3], x[4], x[5])
    change[3], change[4], change[5] = angular_acceleration(rate, wrench.moment_n_m, h, h_rate, parameters.inertia_kg_m2)


@compiled
def _wrench(x: Array, R: Matrix, speeds: FourRotors, parameters: Parameters) -> Wrench:
    velocity, rate = (x[0], x[1], x[2]), (x[3], x[4], x[5])
    wind = _rotated_back(R, parameters.wind_enu_m_s)
    rotors = rotor_wrench(speeds, parameters)
    drag = drag_wrench(_sum(velocity, (-wind[0], -wind[1], -wind[2])), rate, speeds, parameters)
    ground = contact_wrench(x[8], velocity, rate, R, parameters)
    force_n = _sum(rotors.force_n, _sum(drag.force_n, ground.force_n))
    return Wrench(force_n, _sum(rotors.moment_n_m, _sum(drag.moment_n_m, ground.moment_n_m)))


@compiled
def _write_motion(change: Array, x: Array, R: Matrix, wrench: Wrench, parameters: Parameters) -> None:
    """Write the rates of velocity, position and attitude: Newton in the body frame, and kinematics."""
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
def _speed_rates(speeds: FourRotors, target: FourRotors, voltage_v: float, parameters: Parameters) -> FourRotors:
    """Return how fast the rotor speeds change: first-order lags towards what the voltage allows of the command."""
    maximum = parameters.top_speed * (voltage_v / parameters.full_voltage_v)
    return (
        _lag(speeds[0], min(target[0], maximum), parameters),
        _lag(speeds[1], min(target[1], maximum), parameters),
        _lag(speeds[2], min(target[2], maximum), parameters),
        _lag(speeds[3], min(target[3], maximum), parameters),
    )


@compiled
def _lag(speed: float, target: float, parameters: Parameters) -> float:
    return (target - speed) / (parameters.lag_up_s if target > speed else parameters.lag_down_s)


@compiled
def _share_held(target: FourRotors, charge_ah: float, parameters: Parameters) -> float:
    """Return the share of the top speed at which rotors that try to follow `target` leave just the voltage for it."""
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
def _voltage_share(target: FourRotors, share: float, charge_ah: float, parameters: Parameters) -> float:
    """Return terminal over full voltage while the rotors turn at `target`, but at most at `share` of the top speed."""
    maximum = share * parameters.top_speed
    speeds = (min(target[0], maximum), min(target[1], maximum), min(target[2], maximum), min(target[3], maximum))
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
