"""The attitude under `lpv-mpc` without binding limits, with the gain of its QP.

The minimum of the QP is a function of attitude error, rates, rotor speeds and the last plan's correction. Its
derivative at rest, level, in hover, is the certified gain; its dependence on attitude and thrust is a remainder.
"""

from itertools import product
from math import exp, radians, sin, sqrt
from typing import Any

import numpy as np

from colibri.autopilot.control.interface import AttitudeDemand, VehicleState
from colibri.autopilot.control.lpv_mpc.deviations import DEVIATIONS, ROTATION
from colibri.autopilot.control.lpv_mpc.law import LawMemory, LpvMpc, LpvMpcSettings
from colibri.autopilot.control.lpv_mpc.mpc import Mpc, Plan
from colibri.autopilot.control.lpv_mpc.planning import PREDICTED
from colibri.autopilot.control.qp import QpSolver
from colibri.autopilot.control.scaling import scaled
from colibri.certification.attitude import (
    ANGLES,
    INPUTS,
    M1,
    M3,
    MIRRORS,
    RATES,
    STATES,
    AttitudeNumbers,
    CertifiedConditions,
    Momentum,
)
from colibri.certification.loop import RangeError
from colibri.common.config import read_settings
from colibri.common.elementary import square
from colibri.common.rotations import euler_from_quaternion, quaternion_from_euler, quaternion_product
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle

_DIGITS = 10
_GAIN_DIGITS = 8
_MOMENTS, _COMMANDS = slice(M1, M3 + 1), slice(STATES, STATES + INPUTS)
_STEP = 1e-4  # step of a derivative, rad, rad/s and N m
_SPARED = 0.2  # squared speed that moments leave to every rotor
HELD_RAD = radians(20.0)  # largest held |phi| and |theta|
_GRID = 4
_BETWEEN = 1.5  # difference anywhere over the largest on a grid
_ETA_SPARE = 1e-9


class PlannedAttitude:
    """An unconstrained attitude law; C as in `AttitudeNumbers`."""

    thrust_part = 0.5  # the rest is the rotors' for moments

    def __init__(self, table: dict[str, Any], vehicle: Vehicle, conditions: CertifiedConditions) -> None:
        self._settings = read_settings(scaled("lpv-mpc", table, vehicle), LpvMpcSettings)
        self._vehicle, self.conditions = vehicle, conditions
        self._law = LpvMpc(table, vehicle, lambda: 0.0)
        plan, weights, qp = self._settings.plan, self._settings.weights, self._settings.qp
        solver = QpSolver(qp.solver, qp.tolerance, qp.max_iterations)
        mpc = Mpc(plan, weights, vehicle, solver, self._settings.control_interval_s, lambda: 0.0)
        self._from_wrench, self._to_wrench = mpc.from_wrench, self._law.tracker.allocation
        of_state = np.zeros((len(mpc.terminal_on_hold), STATES + INPUTS))
        of_state[range(ROTATION, DEVIATIONS), ANGLES + RATES] = 1.0
        of_state[DEVIATIONS : DEVIATIONS + len(self._from_wrench), _MOMENTS] = self._from_wrench[:, 1:]
        self.terminal_weight = of_state.T @ mpc.terminal_on_hold @ of_state
        self._horizon = sum(self._settings.plan.blocks)
        capacity_ah = vehicle.battery.capacity_ah if vehicle.battery else 0.0
        self._charge_ah = conditions.charge_part * capacity_ah
        self.max_squared = square(self._law.tracker.battery.max_common_speed(self._charge_ah))
        self._min_squared = square(self._law.tracker.lag.min_speed)
        hover_n, span_n = vehicle.body.mass_kg * vehicle.gravity_m_s2, float(self._to_wrench[0].sum())
        self.thrust_n = (self._min_squared * span_n, hover_n, self.max_squared * span_n)
        self.commanded = np.array([_mirrored(rows) for rows in self._gain(0.0, hover_n).round(_GAIN_DIGITS)])

    def ranges(self, numbers: AttitudeNumbers) -> str:
        return ", ".join(f"{angle:.1f}" for angle in np.degrees(2.0 * np.arcsin(0.5 * np.array(numbers.angles[:-1]))))

    def thrusts_n(self, scale: float) -> tuple[float, float]:
        """Return the range of the thrust at a scale."""
        (low, hover, high), part = self.thrust_n, self.thrust_part * scale
        return hover - part * (hover - low), hover + part * (high - hover)

    def momentum(self, thrusts_n: Array) -> Momentum:
        momentum = self._vehicle.momentum_along_z() * self._vehicle.rotors.max_speed
        from_moments = self._from_wrench[:, 1:]
        level = thrusts_n[:, None] * self._from_wrench[:, 0]

        def of_moments(moments: Array, changes: Array) -> tuple[Array, Array]:
            speeds = np.sqrt(level + moments @ from_moments.T)
            return speeds @ momentum, (0.5 * changes @ from_moments.T / speeds) @ momentum

        return of_moments

    def numbers_at(self, scale: float) -> AttitudeNumbers:
        vehicle, settings = self._vehicle, self._settings
        thrusts_n, from_moments = self.thrusts_n(scale), self._from_wrench[:, 1:]
        least, most = (n / float(self._to_wrench[0].sum()) for n in thrusts_n)
        headroom = min(self.max_squared - most, least - max(self._min_squared, _SPARED * least))
        slowest, fastest = sqrt(max(least - headroom, 0.0)), sqrt(most + headroom)
        momentum = self._law.tracker.model["momentum"][0]
        # Squared speeds that change by ds change speeds by ds / (before + after).
        slow, fast = 0.5 / slowest, 0.5 / fastest
        largest = [round(2.0 * sin(0.5 * scale * radians(settings.plan.max_tilt_deg)), _DIGITS)] * INPUTS
        eta = sqrt(max(1.0 - 0.25 * sum(map(square, largest)), 0.0)) - _ETA_SPARE
        weights = settings.weights
        lag = vehicle.rotors.lag
        lag_s = max(lag.time_constant_up_s, lag.time_constant_down_s) if lag else 0.0
        each = 1.0 / settings.plan.count_every
        return AttitudeNumbers(
            interval_s=settings.control_interval_s,
            lag_s=lag_s,
            stays=exp(-settings.control_interval_s / lag_s) if lag_s else 0.0,
            inertia_kg_m2=list(vehicle.body.inertia_kg_m2),
            commanded=self.commanded.tolist(),
            unsure=self._unsure(thrusts_n).tolist(),
            angles=[*largest, round(eta, _DIGITS)],
            rates_rad_s=[round(scale * rate, _DIGITS) for rate in settings.plan.max_rate_rad_s],
            momentum_n_m_s=round(float(np.abs(momentum).sum()) / 2.0 * (fastest - slowest), _DIGITS),
            spin_s=round(float(-0.5 * (slow + fast) * momentum @ from_moments[:, 2]), _DIGITS),
            spin_spread_s=(0.5 * (slow - fast) * np.abs(momentum) @ np.abs(from_moments)).round(_DIGITS).tolist(),
            max_increment_n_m=[],
            from_moments=from_moments.tolist(),
            to_moments=self._to_wrench[1:].tolist(),
            headroom=round(headroom, _DIGITS),
            disturbance_n_m=self.conditions.disturbance_n_m,
            angle_weight=[each * weights.tilt, each * weights.tilt, each * weights.heading],
            rate_weight=[each * weights.rate] * 3,
            increment_weight=(weights.first_correction * np.abs(from_moments.T @ from_moments).sum(axis=1)).tolist(),
        )

    def decide(
        self, z: Array, held: tuple[float, float, float], thrust_n: float, plan: Plan | None
    ) -> tuple[Any, Plan]:
        law, n = self._law, self._law.preview.samples
        if plan is None:
            steady = self._squared(thrust_n, z[_COMMANDS])
            states = np.zeros((self._horizon + 1, PREDICTED + len(self._from_wrench)))
            states[:, PREDICTED:] = self._squared(thrust_n, 0.0 * z[_COMMANDS])
            plan = Plan(np.tile(steady, (self._horizon, 1)), states)
        tracked = law.initial(0.0).tracked._replace(charge_ah=self._charge_ah)
        tracked.rotors[1] = np.sqrt(self._squared(thrust_n, z[_MOMENTS]))
        half = 0.5 * z[ANGLES]
        attitude = quaternion_product(quaternion_from_euler(*held), (sqrt(1.0 - half @ half), *half.tolist()))
        nowhere, (p, q, r) = (0.0, 0.0, 0.0), z[RATES].tolist()
        state = VehicleState(nowhere, nowhere, attitude, euler_from_quaternion(attitude), (p, q, r))
        demand = AttitudeDemand(np.tile(held, (n, 1)), np.zeros((n, 3)), np.full(n, thrust_n))
        after, _ = law.step_attitude(LawMemory(tracked, plan, 1, 0), 0, state, demand)
        made = after.plan
        if made is None:
            raise RangeError("the law makes no plan there")
        first = self._settings.plan.blocks[0]
        remembered = np.vstack([made.commands, made.commands[-1:]])[1 : 1 + first].mean(axis=0)
        return np.array([self._to_wrench[1:] @ made.commands[0], self._to_wrench[1:] @ remembered]), made

    def _squared(self, thrust_n: float, moments: Array) -> Array:
        squared: Array = self._from_wrench @ np.array([thrust_n, *moments])
        return squared

    def _gain(self, phi: float, thrust_n: float) -> Array:
        """Return the gain of commanded and remembered moments, (2, 3, 12)."""
        columns = []
        for step in _STEP * np.eye(STATES + INPUTS):
            above, _ = self.decide(step, (phi, 0.0, 0.0), thrust_n, None)
            below, _ = self.decide(-step, (phi, 0.0, 0.0), thrust_n, None)
            columns.append((above - below) / (2.0 * _STEP))
        return np.stack(columns, axis=2)

    def _unsure(self, thrusts_n: tuple[float, float]) -> Array:
        grid = product(np.linspace(-HELD_RAD, HELD_RAD, _GRID + 1).tolist(), (*thrusts_n, self.thrust_n[1]))
        differs = [np.abs(self._gain(phi, thrust_n) - self.commanded) for phi, thrust_n in grid]
        unsure: Array = (_BETWEEN * np.max(differs, axis=0)).round(_GAIN_DIGITS)
        return unsure


class PlanFlyer:
    """Flights by the law's own steps, each with its plan."""

    def __init__(self, law: PlannedAttitude, held: Array, thrusts_n: Array) -> None:
        self._law, self._held, self._thrusts_n = law, held.tolist(), thrusts_n
        self._plans: list[Plan | None] = [None] * len(held)

    def commands(self, z: Array) -> tuple[Array, Array]:
        both = np.empty((len(z), 2, INPUTS))
        for i, thrust_n in enumerate(self._thrusts_n.tolist()):
            phi, theta, psi = self._held[i]
            both[i], self._plans[i] = self._law.decide(z[i], (phi, theta, psi), thrust_n, self._plans[i])
        return both[:, 0], both[:, 1]


def _mirrored(rows: Array) -> Array:
    """Drop entries of (3, 12) that are not their own mirror image."""
    signs = np.array(MIRRORS)
    own = (signs[:, _MOMENTS, None] * signs[:, None, :] == 1).all(axis=0)
    return np.where(own, rows, 0.0)
