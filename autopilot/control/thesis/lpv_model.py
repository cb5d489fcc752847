"""The LPV models of attitude and position, THESIS [3.1-3.4], and their discretisation."""

from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np

from colibri.common.kernels import cos, sin
from colibri.common.matrices import dot, expm
from colibri.common.types import Array, PerRotor
from colibri.plant.vehicle.description import Vehicle, load_vehicle

Discretisation: TypeAlias = Literal["zero-order-hold", "forward-euler"]

ATTITUDE_OUTPUT = np.array([[1.0, 0, 0, 0, 0, 0], [0, 0, 1.0, 0, 0, 0], [0, 0, 0, 0, 1.0, 0]])  # C: phi, theta, psi


def attitude_model(
    phi_rate: float, theta_rate: float, rotor_momentum_n_m_s: float, *, inertia_kg_m2: tuple[float, float, float]
) -> tuple[Array, Array]:
    """Return A (6, 6) and B (6, 3) at one scheduling point, THESIS [3.3].

    State [phi phi' theta theta' psi psi'], inputs U2, U3, U4. The momentum is h along body z: THESIS's Ω J.
    """
    ix, iy, iz = inertia_kg_m2
    h = rotor_momentum_n_m_s
    A = np.zeros((6, 6))
    A[0, 1] = A[2, 3] = A[4, 5] = 1.0
    A[1, 3], A[1, 5] = -h / ix, theta_rate * (iy - iz) / ix
    A[3, 1], A[3, 5] = h / iy, phi_rate * (iz - ix) / iy
    A[5, 1], A[5, 3] = 0.5 * theta_rate * (ix - iy) / iz, 0.5 * phi_rate * (ix - iy) / iz
    B = np.zeros((6, 3))
    B[1, 0], B[3, 1], B[5, 2] = 1.0 / ix, 1.0 / iy, 1.0 / iz
    return A, B


GLOBAL_OUTPUT = np.zeros((4, 12))  # C: x, y, z, psi
GLOBAL_OUTPUT[[0, 1, 2, 3], [0, 2, 4, 10]] = 1.0


def global_model(
    attitude: tuple[Array, Array],
    euler: tuple[float, float, float],
    thrust_n: float,
    *,
    mass_kg: float,
    gravity_m_s2: float,
) -> tuple[Array, Array]:
    """Return A (12, 12) and B (12, 4) of position and attitude, THESIS [3.1, 3.4].

    State [x x' y y' z z' phi phi' theta theta' psi psi'], ENU, inputs U1..U4. Thrust acts on the position through B
    alone; gravity is divided by the last U1 to fit in.
    """
    phi, theta, psi = euler
    A, B = np.zeros((12, 12)), np.zeros((12, 4))
    A[0, 1] = A[2, 3] = A[4, 5] = 1.0
    A[6:, 6:], B[6:, 1:] = attitude
    B[1, 0] = (cos(phi) * sin(theta) * cos(psi) + sin(phi) * sin(psi)) / mass_kg
    B[3, 0] = (cos(phi) * sin(theta) * sin(psi) - sin(phi) * cos(psi)) / mass_kg
    B[5, 0] = -gravity_m_s2 / thrust_n + cos(phi) * cos(theta) / mass_kg
    return A, B


def discretise(A: Array, B: Array, interval_s: float, method: Discretisation) -> Array:
    """Return [[Ad, Bd], [0, I]] of x[k+1] = Ad x[k] + Bd u[k].

    Zero-order hold is the exponential of [[A, B], [0, 0]] (Van Loan, 1978), forward Euler its first-order term.
    """
    n, m = B.shape
    block = np.zeros((n + m, n + m))
    block[:n, :n], block[:n, n:] = interval_s * A, interval_s * B
    return expm(block) if method == "zero-order-hold" else np.eye(n + m) + block


STATES = ("phi", "phi_rate", "theta", "theta_rate", "psi", "psi_rate")
INPUTS = ("U2", "U3", "U4")
OUTPUTS = ("phi", "theta", "psi")


class Point(NamedTuple):
    """A scheduling point; the default is hover.

    Attributes:
        phi_rate_rad_s, theta_rate_rad_s: Derivatives of the Euler angles.
        rotor_speeds: In the vehicle's unit and rotor order.
    """

    phi_rate_rad_s: float = 0.0
    theta_rate_rad_s: float = 0.0
    rotor_speeds: PerRotor = (0.0, 0.0, 0.0, 0.0)


HOVER = Point()


class LpvModel(NamedTuple):
    """A linear model: rad, rad/s and N m, in the order of `STATES`, `INPUTS` and `OUTPUTS`.

    Attributes:
        interval_s: Of a sampled model; `None` for a continuous one.
    """

    A: Array  # (6, 6)
    B: Array  # (6, 3)
    C: Array  # (3, 6)
    D: Array  # (3, 3), zero
    interval_s: float | None = None

    def sampled(self, interval_s: float, method: Discretisation = "zero-order-hold") -> "LpvModel":
        """Return the model of samples `interval_s` apart."""
        if self.interval_s is not None or not interval_s > 0.0:
            raise ValueError(f"interval_s must be above 0 s, of a continuous model, not {interval_s!r}")
        n = len(self.A)
        transition = discretise(self.A, self.B, interval_s, method)
        return LpvModel(transition[:n, :n], transition[:n, n:], self.C, self.D, interval_s)


def model(vehicle: Any, point: Point = HOVER) -> LpvModel:
    """Return the model of a vehicle, by its name, file or object, at a scheduling point."""
    flown: Vehicle = load_vehicle(vehicle)
    momentum = dot(flown.rotor_momentum(), np.array(point.rotor_speeds, dtype=np.float64))
    A, B = attitude_model(
        point.phi_rate_rad_s, point.theta_rate_rad_s, momentum, inertia_kg_m2=flown.body.inertia_kg_m2
    )
    return LpvModel(A, B, ATTITUDE_OUTPUT.copy(), np.zeros((3, 3)))
