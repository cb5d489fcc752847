"""The nonlinear rigid body, THESIS [2.8], as pure functions.

The state is the thesis's with the attitude as a quaternion, so that no attitude is singular:
`[u v w p q r x y z qw qx qy qz]`: body velocity m/s and body rates rad/s in FLU, position m in ENU, and the unit
quaternion that turns FLU into ENU.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from mavlink.frames import Quaternion, Vector, rotation_matrix

STATE = ("u", "v", "w", "p", "q", "r", "x", "y", "z", "qw", "qx", "qy", "qz")


class Wrench(NamedTuple):
    """What the rotors do to the body.

    Attributes:
        thrust_n: U1, along body z, N.
        moment_n_m: U2, U3, U4 about body x, y, z, N m.
        rotor_momentum_n_m_s: Angular momentum h of the rotors along body z, N m s.
    """

    thrust_n: float
    moment_n_m: Vector
    rotor_momentum_n_m_s: float


def rigid_body(
    wrench: Wrench, *, mass_kg: float, gravity_m_s2: float, inertia_kg_m2: Vector
) -> Callable[[Sequence[float]], list[float]]:
    """Return f of x' = f(x) under a constant wrench: `STATE`, 13 values, to its time derivative.

    Newton-Euler in the body frame: the moment that the rotors' momentum h adds is -ω × (0, 0, h) = (-q h, p h, 0),
    which does no work. With THESIS's Ω and J, h = -J Ω (erratum 2).

    Args:
        wrench: Thrust, moments and rotor momentum in FLU.
        mass_kg: Mass.
        gravity_m_s2: Gravitational acceleration, towards -z of ENU.
        inertia_kg_m2: Ix, Iy, Iz.
    """
    ix, iy, iz = inertia_kg_m2
    u2, u3, u4 = wrench.moment_n_m
    h = wrench.rotor_momentum_n_m_s
    lift_m_s2 = wrench.thrust_n / mass_kg
    g = gravity_m_s2

    def derivative(state: Sequence[float]) -> list[float]:
        u, v, w, p, q, r, _, _, _, qw, qx, qy, qz = state
        (r11, r12, r13), (r21, r22, r23), (r31, r32, r33) = rotation_matrix((qw, qx, qy, qz))
        return [
            v * r - w * q - g * r31,
            w * p - u * r - g * r32,
            u * q - v * p - g * r33 + lift_m_s2,
            (q * r * (iy - iz) - q * h + u2) / ix,
            (p * r * (iz - ix) + p * h + u3) / iy,
            (p * q * (ix - iy) + u4) / iz,
            r11 * u + r12 * v + r13 * w,
            r21 * u + r22 * v + r23 * w,
            r31 * u + r32 * v + r33 * w,
            -0.5 * (qx * p + qy * q + qz * r),
            0.5 * (qw * p + qy * r - qz * q),
            0.5 * (qw * q + qz * p - qx * r),
            0.5 * (qw * r + qx * q - qy * p),
        ]

    return derivative


def attitude_of(state: Sequence[float]) -> Quaternion:
    """Return the attitude quaternion of a state."""
    qw, qx, qy, qz = state[9:13]
    return (qw, qx, qy, qz)
