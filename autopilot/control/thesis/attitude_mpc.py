"""The inner loop: LPV model at the present state, MPC, one increment of the moments."""

import numpy as np

from colibri.autopilot.control.interface import Clock
from colibri.autopilot.control.qp import QpSolver
from colibri.autopilot.control.thesis.condensed_mpc import Solution, Weights, augment, condense, solve
from colibri.autopilot.control.thesis.lpv_model import ATTITUDE_OUTPUT, Discretisation, attitude_model, discretise
from colibri.common.compiled_rotations import euler_rates
from colibri.common.config import Count, Positive, Table
from colibri.common.types import Array, Vector
from colibri.plant.vehicle.description import Vehicle

PerAxis = tuple[Positive, Positive, Positive]


class AttitudeSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The inner loop."""

    horizon: Count
    shrinking_horizon: bool
    discretisation: Discretisation
    output_weight: PerAxis
    terminal_weight: PerAxis
    increment_weight: PerAxis


class AttitudeMpc:
    """LPV-MPC of roll, pitch and yaw."""

    def __init__(
        self, settings: AttitudeSettings, vehicle: Vehicle, solver: QpSolver, interval_s: float, clock: Clock
    ) -> None:
        self._discretisation = settings.discretisation
        self._inertia = vehicle.body.inertia_kg_m2
        self._solver = solver
        self._interval_s = interval_s
        self._clock = clock
        self._weights = Weights(
            np.array(settings.output_weight), np.array(settings.terminal_weight), np.array(settings.increment_weight)
        )
        self._max_increment = 2.0 * vehicle.max_wrench()[1:]

    def step(
        self,
        euler: Vector,
        rate: Vector,
        moment_n_m: Array,
        rotor_momentum_n_m_s: float,  # h at the last commands
        reference: Vector,  # constant over the horizon
        horizon: int,
    ) -> Solution:
        """Return the increments of U2, U3, U4, bounded by full moment to full moment."""
        phi, theta, psi = euler
        phi_rate, theta_rate, psi_rate = euler_rates(phi, theta, rate)
        A, B = attitude_model(phi_rate, theta_rate, rotor_momentum_n_m_s, inertia_kg_m2=self._inertia)
        model = augment(discretise(A, B, self._interval_s, self._discretisation), ATTITUDE_OUTPUT)
        x = np.array([phi, phi_rate, theta, theta_rate, psi, psi_rate, *moment_n_m])
        references = np.array([reference] * horizon)
        return solve(
            condense(model, horizon, x, references, self._weights), self._max_increment, self._solver, self._clock
        )
