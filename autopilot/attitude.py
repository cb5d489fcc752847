"""The inner loop: LPV model at the present state, MPC over the horizon, one increment of the moments."""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from autopilot.lpv import OUTPUT, attitude_model, discretise
from autopilot.mpc import Weights, augment, condense
from autopilot.profile import AttitudeSettings
from autopilot.qp import QpSolver, QpStatus
from mavlink.frames import Vector, euler_rates
from plant.vehicle import Vehicle

Array: TypeAlias = NDArray[np.float64]


class AttitudeStep(NamedTuple):
    """What one step of the attitude MPC decided.

    Attributes:
        moment_n_m: U2, U3, U4, N m.
        status: How the QP ended; if it was not solved, the moments are the last ones.
        solve_time_s: Time that the QP took.
    """

    moment_n_m: Array
    status: QpStatus
    solve_time_s: float


class AttitudeMpc:
    """LPV-MPC of roll, pitch and yaw."""

    def __init__(
        self,
        settings: AttitudeSettings,
        vehicle: Vehicle,
        solver: QpSolver,
        interval_s: float,
        clock: Callable[[], float],
    ) -> None:
        """Control `vehicle` every `interval_s`; `clock` only measures, it decides nothing."""
        self._settings = settings
        self._inertia = vehicle.body.inertia_kg_m2
        self._solver = solver
        self._interval_s = interval_s
        self._clock = clock
        self._weights = Weights(
            np.array(settings.output_weight), np.array(settings.terminal_weight), np.array(settings.increment_weight)
        )
        self._largest_increment = 2.0 * _largest_moments(vehicle)

    def step(
        self,
        euler: Vector,
        rate: Vector,
        moment_n_m: Array,
        rotor_momentum_n_m_s: float,
        reference: Vector,
        horizon: int,
    ) -> AttitudeStep:
        """Decide the moments to hold until the next step.

        Args:
            euler: phi, theta, psi, rad.
            rate: Body rates p, q, r in FLU, rad/s.
            moment_n_m: The last U2, U3, U4, N m, (3,).
            rotor_momentum_n_m_s: h of the rotor speeds last commanded.
            reference: phi, theta, psi wanted, rad; constant along the horizon.
            horizon: Number of steps to predict.
        """
        phi, theta, psi = euler
        phi_rate, theta_rate, psi_rate = euler_rates(phi, theta, rate)
        A, B = attitude_model(phi_rate, theta_rate, rotor_momentum_n_m_s, inertia_kg_m2=self._inertia)
        model = augment(discretise(A, B, self._interval_s, self._settings.discretisation), OUTPUT)
        x = np.array([phi, phi_rate, theta, theta_rate, psi, psi_rate, *moment_n_m])
        references = np.broadcast_to(np.array(reference), (horizon, 3))
        qp = condense(model, horizon, x, references, self._weights)
        bound = np.tile(self._largest_increment, horizon)
        started_s = self._clock()
        result = self._solver.solve(qp.H, qp.f, -bound, bound)
        solve_time_s = self._clock() - started_s
        increment = np.zeros(3) if result.x is None else result.x[:3]
        return AttitudeStep(moment_n_m + increment, result.status, solve_time_s)


def _largest_moments(vehicle: Vehicle) -> Array:
    """Return the largest moment that the rotors can make about each axis, N m, (3,)."""
    squared_max = vehicle.rotors.max_speed**2
    largest: Array = np.clip(vehicle.allocation()[1:] * squared_max, 0.0, None).sum(axis=1)
    return largest
