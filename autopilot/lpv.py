"""The LPV model of the attitude, THESIS [3.3], and its discretisation."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from autopilot.profile import Discretisation

Array: TypeAlias = NDArray[np.float64]

OUTPUT = np.array([[1.0, 0, 0, 0, 0, 0], [0, 0, 1.0, 0, 0, 0], [0, 0, 0, 0, 1.0, 0]])
"""C: the outputs phi, theta, psi of the state [phi phi' theta theta' psi psi']."""


def attitude_model(
    phi_rate: float, theta_rate: float, rotor_momentum_n_m_s: float, *, inertia_kg_m2: tuple[float, float, float]
) -> tuple[Array, Array]:
    """Return A (6, 6) and B (6, 3) of x' = A x + B u at one scheduling point.

    State [phi phi' theta theta' psi psi'] in rad and rad/s, inputs U2, U3, U4 in N m.

    Args:
        phi_rate: phi', rad/s.
        theta_rate: theta', rad/s.
        rotor_momentum_n_m_s: h along body z, the vehicle's `rotor_momentum` times its rotor speeds: THESIS's Ω J.
        inertia_kg_m2: Ix, Iy, Iz.
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


def discretise(A: Array, B: Array, interval_s: float, method: Discretisation) -> Array:
    """Return [[Ad, Bd], [0, I]] of x[k+1] = Ad x[k] + Bd u[k], (n + m, n + m).

    Zero-order hold is exact for an input held over `interval_s`: the exponential of [[A, B], [0, 0]] (Van Loan, 1978);
    forward Euler is its first-order term. The block is at once the Ã of a model in input increments.
    """
    n, m = B.shape
    block = np.zeros((n + m, n + m))
    block[:n, :n], block[:n, n:] = interval_s * A, interval_s * B
    return expm(block) if method == "zero-order-hold" else np.eye(n + m) + block
