"""The attitude LPV-MPC: predict, condense, solve, read the plan."""

from math import radians
from typing import Annotated, Literal, NamedTuple, TypeAlias

import msgspec
import numpy as np

from colibri.autopilot.control.interface import Active, Clock, Diagnostics
from colibri.autopilot.control.lpv_mpc import condensing, prediction
from colibri.autopilot.control.lpv_mpc.condensing import Problem, Target
from colibri.autopilot.control.lpv_mpc.prediction import INPUTS, STATES, Body, InitialState
from colibri.autopilot.control.parts.riccati import lqr
from colibri.autopilot.control.parts.soft_limits import empty_qp
from colibri.autopilot.control.qp import Qp, QpSolver, QpStatus
from colibri.autopilot.control.vehicle_model.mixer import exact_inverse
from colibri.autopilot.control.vehicle_model.rotor_lag import RotorLag
from colibri.common.config import Count, Degrees, Positive, Table
from colibri.common.elementary import square
from colibri.common.jit import packed
from colibri.common.matrices import matmul, matvec
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle

PerAxis: TypeAlias = tuple[Positive, Positive, Positive]

_BINDING = 1e-6  # a limit is active if this part of it or less is left
_KEPT = 1e-3  # the tilt limit may be exceeded by this part of it


class AttitudeSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The attitude LPV-MPC."""

    moves: Annotated[tuple[Count, ...], msgspec.Meta(min_length=1)]
    """Steps that each planned moment is held for; the horizon is their sum."""
    scheduling: Literal["frozen", "along-plan"]
    """At the present state, or along the last plan."""
    output_weight: PerAxis
    increment_weight: PerAxis
    max_increment_n_m: PerAxis
    max_angle_deg: Degrees
    """Of the tilt, and of phi and theta each."""
    max_rate_rad_s: PerAxis
    check_every: Count
    """Steps between those at which angles and rates are limited."""
    slack_weight: Positive


class Plan(NamedTuple):
    """A solved QP."""

    moments: Array  # commanded at each step, N m, (N, 3)
    states: Array  # predicted, (N + 1, 9)
    angle_slack: float  # violation of the angle limits, in parts of them


class AttitudeMpc:
    """LPV-MPC of roll, pitch and yaw."""

    def __init__(
        self,
        settings: AttitudeSettings,
        vehicle: Vehicle,
        lag: RotorLag,
        solver: QpSolver,
        interval_s: float,
        clock: Clock,
    ) -> None:
        self.horizon = sum(settings.moves)
        self._body = body_of(vehicle)
        self._interval_s = interval_s
        self._solver = solver
        self._clock = clock
        self._along_plan = settings.scheduling == "along-plan"
        output_weight, increment_weight = np.array(settings.output_weight), np.array(settings.increment_weight)
        terminal_weight, self.gain = _riccati(self._body, interval_s, output_weight, increment_weight)
        angle = radians(settings.max_angle_deg)
        self.from_wrench = exact_inverse(vehicle.allocation()) / square(vehicle.rotors.max_speed)
        self.problem = Problem(
            np.cumsum((0, *settings.moves[:-1])),
            np.arange(settings.check_every, self.horizon + 1, settings.check_every),
            output_weight,
            increment_weight,
            terminal_weight,
            np.array(settings.max_increment_n_m),
            np.array([angle, angle, *settings.max_rate_rad_s]),
            self.from_wrench[:, 0].copy(),
            self.from_wrench[:, 1:].copy(),
            square(lag.min_speed),
        )
        self._packed = packed(self.problem)
        moved = INPUTS * len(settings.moves)
        self._schedule = np.empty((self.horizon, len(prediction.SCHEDULE)))
        self._responses = np.zeros((self.horizon + 1, STATES, 1 + moved))
        self._rotor_rows = 2 * condensing.ROTORS * len(settings.moves)
        rows = self._rotor_rows + condensing.MOTION_ROWS * len(self.problem.checked)
        self._qp = empty_qp(moved, condensing.SLACKS, rows, settings.slack_weight)
        self._qp.upper[:moved] = np.tile(self.problem.max_increment, len(settings.moves))
        self._qp.lower[:moved] = -self._qp.upper[:moved]

    def plan(self, now: InitialState, target: Target, ahead: Array | None) -> tuple[Plan | None, Diagnostics]:
        """Plan from `now` towards `target`; the plan is None if the QP is not solved.

        Beyond the tilt limit, a second plan gives up thrust for moments. `ahead`: the previous plan's coming states,
        (n, 9).
        """
        self.predict(now, ahead)
        plan, diagnostics = self._solve(now, target)
        if plan is None or plan.angle_slack <= _KEPT:
            return plan, diagnostics
        middle_n = 0.5 * (self.problem.min_squared + square(now.max_speed)) / float(self.problem.from_thrust.max())
        less_thrust = target._replace(thrust_n=np.minimum(target.thrust_n, middle_n))  # room for moments of either sign
        second, how = self._solve(now, less_thrust)
        how = how._replace(solve_time_s=diagnostics.solve_time_s + how.solve_time_s)
        return (second, how) if second is not None else (plan, diagnostics)

    def _solve(self, now: InitialState, target: Target) -> tuple[Plan | None, Diagnostics]:
        qp = self.condense(now, target)
        started_s = self._clock()
        status, z, iterations = self._solver.solve(qp)
        solve_time_s = self._clock() - started_s
        if z is None:
            return None, Diagnostics(status, solve_time_s=solve_time_s, qp_iterations=iterations)
        plan, diagnostics = self.read(now, target, qp, z, solve_time_s)
        return plan, diagnostics._replace(qp_iterations=iterations)

    def predict(self, now: InitialState, ahead: Array | None) -> None:
        if ahead is not None and len(ahead) and self._along_plan:
            prediction.schedule_along(now.x, ahead, self._schedule)
        else:
            self._schedule[:] = now.x[list(prediction.SCHEDULE)]
        prediction.respond(now, self._schedule, self._body, self.problem.starts, self._interval_s, self._responses)

    def condense(self, now: InitialState, target: Target) -> Qp:
        """Condense the prediction to a QP, in arrays that the next call overwrites.

        The first move may always cancel the last moments, which makes the QP feasible.
        """
        max_squared = square(now.max_speed)
        condensing.condense(self._responses, self._schedule, target, now.u, self._packed, max_squared, self._qp)
        return self._qp

    def read(
        self, now: InitialState, target: Target, qp: Qp, z: Array, solve_time_s: float
    ) -> tuple[Plan, Diagnostics]:
        states, moments, squared = condensing.read_plan(self._responses, self._packed, now.u, z, target.thrust_n)
        active = condensing.count_active(qp.G, qp.h, qp.lower, qp.upper, z, self._rotor_rows, _BINDING)
        diagnostics = Diagnostics(
            QpStatus.SOLVED,
            solve_time_s=solve_time_s,
            cost=condensing.objective(qp.H, qp.f, z),
            active=Active(*active),
            slack=max(z[-condensing.SLACKS :].tolist()),
            predicted=states,
            planned_squared=squared,
        )
        return Plan(moments, states, float(z[-condensing.SLACKS + condensing.ANGLE_SLACK])), diagnostics

    def lqr(self, now: InitialState, target: Target) -> Array:
        state = np.concatenate([now.x, now.u])
        wanted = target.end.copy()
        wanted[list(prediction.ANGLES)] = target.angles[0]
        moments: Array = now.u - matvec(self.gain, state - wanted)
        return moments


def _riccati(body: Body, interval_s: float, output_weight: Array, increment_weight: Array) -> tuple[Array, Array]:
    """Return S (12, 12) and K (3, 12) of the LQR at hover."""
    A = _hover_transition(body, interval_s)
    B = A[:, STATES:]
    C = np.zeros((INPUTS, STATES + INPUTS))
    C[range(INPUTS), prediction.ANGLES] = 1.0
    Q, R = matmul(C.T * output_weight, C), np.diag(increment_weight).copy()
    S, K = lqr(A, B, Q, R)
    return 0.5 * (S + S.T), K


def _hover_transition(body: Body, interval_s: float) -> Array:
    A = np.eye(STATES + INPUTS)
    responses = np.zeros((2, STATES, 1 + INPUTS))
    level, at_once = np.zeros((1, len(prediction.SCHEDULE))), np.zeros(1, dtype=np.int64)
    nothing = np.zeros(INPUTS)
    for state in range(STATES):
        hover = InitialState(np.eye(STATES)[state], nothing, nothing, 0.0, 1.0)
        prediction.respond(hover, level, body, at_once, interval_s, responses)
        A[:STATES, state] = responses[1, :, 0]
    A[:STATES, STATES:] = responses[1, :, 1:]
    return A


def body_of(vehicle: Vehicle) -> Body:
    lag = vehicle.rotors.lag
    lag_1_s = 1.0 / max(lag.time_constant_up_s, lag.time_constant_down_s) if lag else 0.0
    return Body(*vehicle.body.inertia_kg_m2, lag_1_s)
