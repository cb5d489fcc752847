"""The LPV-MPC: linearise about the previous plan, condense, solve, read the plan."""

from math import inf, radians
from typing import Annotated, NamedTuple, TypeAlias

import msgspec
import numpy as np

from colibri.autopilot.control.interface import Active, Clock, Diagnostics
from colibri.autopilot.control.lpv_mpc import constraints, deviations, model, planning, solution
from colibri.autopilot.control.lpv_mpc.cost import CostWeights, Problem
from colibri.autopilot.control.lpv_mpc.model import Lag, Model
from colibri.autopilot.control.lpv_mpc.path import PathNow, read_speeds, speed_effects
from colibri.autopilot.control.lpv_mpc.planning import QpKind, Workspace
from colibri.autopilot.control.parts.riccati import lqr
from colibri.autopilot.control.qp import Qp, QpResult, QpSolver, QpStatus
from colibri.autopilot.control.vehicle_model.airframe import airframe_of
from colibri.autopilot.control.vehicle_model.mixer import exact_inverse, holds_yaw
from colibri.common.config import Count, Degrees, Positive, Table
from colibri.common.elementary import cos, exp, square
from colibri.common.jit import Packed, opened, packed
from colibri.common.matrices import matmul
from colibri.common.records import Record, tuple_of
from colibri.common.types import Array
from colibri.plant.vehicle.description import AXES, Vehicle

_MAX_SLACK = 100.0


class WeightSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The weights of the cost."""

    position: Positive
    velocity: Positive
    tilt: Positive
    """Weight on tilt, used only for demanded attitudes."""
    heading: Positive
    rate: Positive
    thrust: Positive
    """Weight on thrust, used only for demanded attitudes."""
    first_correction: Positive
    next_correction: Positive
    terminal_thrust: Positive
    """Thrust at the terminal cost, part of the weight."""


class PlanSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The MPC."""

    blocks: Annotated[tuple[Count, ...], msgspec.Meta(min_length=1)]
    """Number of steps of each constant correction; the horizon is their sum."""
    count_every: Count
    """Steps between two errors in the cost."""
    max_tilt_deg: Degrees
    max_rate_rad_s: tuple[Positive, Positive, Positive]
    check_every: Count
    """Steps between two checks of the soft limits."""
    slack_weight: Positive


class Plan(Record, frozen=True):
    """A solved QP."""

    commands: Array  # squared speeds at each step, (N, m)
    states: Array  # `planning.PREDICTED`, nan beyond `Mpc.motion_steps`; squared speeds of m rotors, (N + 1, 12 + m)
    speeds: Array | None = None  # along the path, (N + 2,); None by the clock


Corrections: TypeAlias = tuple[QpStatus, Array | None, float, float, tuple[int, int]]
"""Status of the last QP; changes of the corrections, (n,); iterations, 0 without a solver; largest violation of a soft
limit, in parts of it; active soft limits of tilt and of rates."""


class Qps(NamedTuple):
    """A packed `QpKind`, the two QPs in its memory, and room for the minimum of the first."""

    kind: Packed
    free: Qp
    limited: Qp
    minimum: Array


class Mpc:
    """LPV-MPC of position, attitude and rotors together."""

    def __init__(
        self,
        settings: PlanSettings,
        weights: WeightSettings,
        vehicle: Vehicle,
        solver: QpSolver,
        interval_s: float,
        clock: Clock,
        *,
        upright: bool = True,
    ) -> None:
        self.horizon, rotors = sum(settings.blocks), vehicle.rotors.count
        n = self.horizon
        self._solver, self._clock = solver, clock
        numbers = model_of(vehicle, interval_s)
        self.model = packed(numbers)
        self.turns = holds_yaw(vehicle)
        self.from_wrench = exact_inverse(numbers.allocation)  # U1..U4, N, N m, to squared speeds, (m, 4)
        starts = np.cumsum((0, *settings.blocks))
        means, levels = lagging(starts, numbers.lag)
        each = len(AXES) / rotors  # a force takes smaller changes of more rotors
        on_hold = CostWeights(
            0.0, 0.0, weights.tilt, weights.heading if self.turns else 0.0, weights.rate, weights.thrust,
            each * weights.first_correction, each * weights.next_correction,
        )  # fmt: skip
        on_track = on_hold._replace(position=weights.position, velocity=weights.velocity, tilt=0.0, thrust=0.0)
        thrust_n = weights.terminal_thrust * vehicle.body.mass_kg * vehicle.gravity_m_s2
        terminals = {each: self._terminal(each, settings.count_every, thrust_n) for each in (on_hold, on_track)}
        self.terminal_on_hold = terminals[on_hold]
        self.starts, self._effects = starts, speed_effects(starts, interval_s)
        blocks, rows = len(settings.blocks), constraints.MOTION_ROWS * (n // settings.check_every)
        shared = Workspace(
            np.empty((n, rotors)),
            np.empty((blocks + 1, rotors)),
            np.empty((n + 1, model.RIGID)),
            np.empty((n + 1, rotors)),
            model.empty_drive(n, rotors),
            deviations.empty_transition(n, rotors),
            np.empty(0),
            means,
            levels,
        )
        self.on_clock, self.on_path, self.on_hold = (
            _opened(
                QpKind(
                    Problem(
                        starts,
                        np.arange(settings.count_every, n + 1, settings.count_every),
                        np.arange(settings.check_every, n + 1, settings.check_every),
                        each,
                        terminals[each],
                        numbers.allocation[0].copy(),
                        levels,
                        upright,
                        cos(radians(settings.max_tilt_deg)) if settings.max_tilt_deg < 180.0 else -inf,
                        np.array(settings.max_rate_rad_s) * ((1.0, 1.0, 1.0) if self.turns else (1.0, 1.0, inf)),
                    ),
                    shared._replace(responses=np.zeros((n + 1, deviations.DEVIATIONS, inputs * blocks))),
                    empty_qp(inputs * blocks, 0, 0, settings.slack_weight),
                    empty_qp(inputs * blocks, constraints.SLACKS, rows, settings.slack_weight),
                )
            )
            for each, inputs in ((on_track, rotors), (on_track, rotors + 1), (on_hold, rotors))
        )
        self._commands, self._states = (n, rotors), (n + 1, planning.PREDICTED + rotors)
        self.motion_steps = n + 1  # of a plan whose motion is computed

    def _terminal(self, weights: CostWeights, count_every: int, thrust_n: float) -> Array:
        """Return S of the LQR in level flight after the horizon, filled up with zeros to a multiple of four."""
        A, B = deviations.hover_transition(thrust_n, self.model, self.horizon)
        Q, rotors = np.zeros_like(A), B.shape[1]
        of_axes = [weights.position] * 3 + [weights.velocity] * 3 + [weights.tilt] * 2 + [weights.heading]
        np.fill_diagonal(Q, np.array([*of_axes, *([weights.rate] * 3), *([0.0] * rotors)]) / count_every)
        thrust = np.array(self.model["allocation"][0, 0])
        Q[12:, 12:] += weights.thrust / count_every * thrust[:, None] * thrust
        if rotors > len(AXES):  # speeds without effect return to those of the references
            Q[12:, 12:] += weights.next * (np.eye(rotors) - matmul(self.from_wrench, self.model["allocation"][0]))
        kept = np.arange(0 if weights.position > 0.0 else deviations.ROTATION, len(A))
        if not self.turns:
            kept = np.setdiff1d(kept, (deviations.ROTATION + 2, deviations.RATE + 2))
        square = np.ix_(kept, kept)
        S = np.zeros((-(-len(A) // 4) * 4,) * 2)
        cost, _ = lqr(
            np.ascontiguousarray(A[square]), np.ascontiguousarray(B[kept]), np.ascontiguousarray(Q[square]),
            weights.next * np.eye(rotors),
        )  # fmt: skip
        S[square] = 0.5 * (cost + cost.T)
        return S

    def condense(
        self, qps: Qps, now: Packed, target: Packed, last: Array, along_n: float, airborne: bool, path: PathNow | None
    ) -> None:
        """Fill the QP from `now` towards `target`, see `planning.condense`; with a `path` its speed is free."""
        if path is None:
            planning.condense(now, target, last, along_n, airborne, self.model, qps.kind)
        else:
            planning.condense_on_path(now, target, last, along_n, airborne, path, self._effects, self.model, qps.kind)

    def plan(
        self, qps: Qps, psi: float, path: PathNow | None, mass_kg: float, path_lag_s: float
    ) -> tuple[Plan | None, Diagnostics]:
        """Solve the QP and read its plan, None if it is not solved; `psi` is unwrapped."""
        commands, states = np.empty(self._commands), np.empty(self._states)
        started_s = self._clock()
        z: Array | None = qps.minimum
        is_free, is_beyond, bounds = solution.plan(
            qps.kind, qps.minimum, False, psi, self.motion_steps, commands, states
        )
        status, iterations, slack, tilts, rates = QpStatus.SOLVED, 0.0, 0.0, 0, 0
        if is_beyond or not is_free:
            status, z, iterations, slack, (tilts, rates) = self._solve(*qps, is_free=is_free)
            if z is not None:
                _, _, bounds = solution.plan(qps.kind, z, True, psi, self.motion_steps, commands, states)
        solve_time_s = self._clock() - started_s
        if z is None:
            unsolved = Diagnostics(status, solve_time_s=solve_time_s, mass_kg=mass_kg, path_lag_s=path_lag_s)
            return None, unsolved._replace(qp_iterations=iterations)
        active = tuple_of(Active, (bounds, 0, tilts, rates))
        shown, squared = (states, commands) if self.motion_steps > self.horizon else (None, None)
        diagnostics = tuple_of(
            Diagnostics,
            (status, None, solve_time_s, 0.0, active, slack, shown, squared, mass_kg, path_lag_s, iterations),
        )
        speeds = None if path is None else read_speeds(path.speeds, self._effects.shares, z)
        return Plan(commands, states, speeds), diagnostics

    def warm_up(self) -> None:
        """Load compiled code of the soft limits, after a first plan."""
        solution.limit(self.on_clock.kind)
        z = np.zeros(len(self.on_clock.free.f))
        solution.is_beyond(self.on_clock.kind, z)
        solution.count_active(self.on_clock.kind, z)

    def _solve(self, kind: Packed, free: Qp, limited: Qp, minimum: Array, *, is_free: bool) -> Corrections:
        """Return the optimal changes of the corrections, where the unconstrained `minimum` is beyond a limit.

        If it `is_free`, it is within the rotor limits; a plan beyond a soft limit is solved again.
        """
        status, z, iterations = QpResult(QpStatus.SOLVED, minimum, 0) if is_free else self._solver.solve(free)
        if z is None or not (is_free or solution.is_beyond(kind, z)):
            return status, z, iterations, 0.0, (0, 0)
        solution.limit(kind)
        status, z, more = self._solver.solve(limited)
        iterations += more
        if z is None:
            return status, z, iterations, 0.0, (0, 0)
        slack, soft = max(z[len(free.f) :].tolist()), solution.count_active(kind, z)
        return status, z[: len(free.f)].copy(), iterations, slack, soft


def model_of(vehicle: Vehicle, interval_s: float) -> Model:
    """Return the model, with the slower of the rotors' two lags."""
    times = vehicle.rotors.lag
    lag = Lag(0.0, 0.0, 0.0, 0.0)
    if times:
        rate_1_s = 1.0 / max(times.time_constant_up_s, times.time_constant_down_s)
        left = exp(-interval_s * rate_1_s)
        lag = Lag(left, exp(-0.5 * interval_s * rate_1_s), (1.0 - left) / (interval_s * rate_1_s), rate_1_s)
    return Model(
        airframe_of(vehicle),
        np.array(vehicle.body.inertia_kg_m2),
        vehicle.allocation() * square(vehicle.rotors.max_speed),
        vehicle.momentum_along_z() * vehicle.rotors.max_speed,
        lag,
        interval_s,
    )


def empty_qp(moved: int, slacks: int, rows: int, slack_weight: float) -> Qp:
    """Return the empty QP of a plan: planned variables, then slacks of soft limits."""
    n = moved + slacks
    H, f = np.zeros((n, n)), np.zeros(n)
    H[moved:, moved:] = slack_weight * np.eye(slacks)
    f[moved:] = slack_weight
    return Qp(H, f, np.zeros((rows, n)), np.zeros(rows), np.zeros(n), np.full(n, _MAX_SLACK))


def lagging(starts: Array, lag: Lag) -> tuple[Array, Array]:
    """Return squared speeds by a unit command in each block: step means, (b, N), and ends, (b, N + 1)."""
    blocks, steps = len(starts) - 1, int(starts[-1])
    means, levels = np.zeros((blocks, steps)), np.zeros((blocks, steps + 1))
    for block in range(blocks):
        for step in range(int(starts[block]), steps):
            command = 1.0 if step < starts[block + 1] else 0.0
            away = levels[block, step] - command
            means[block, step] = command + away * lag.left_mean
            levels[block, step + 1] = command + away * lag.left
    return means, levels


def _opened(kind: QpKind) -> Qps:
    record = packed(kind)
    free, limited = opened(record["qp"], Qp), opened(record["limited"], Qp)
    return Qps(record, free, limited, np.empty(len(free.f)))
