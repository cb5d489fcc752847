"""The LPV-MPC as a control law: references, observers and fallbacks."""

from collections.abc import Mapping
from math import ceil, nan, radians
from typing import Annotated, Any, TypeAlias

import msgspec
import numpy as np

from colibri.autopilot.control.interface import (
    AT_REST,
    AttitudeController,
    AttitudeDemand,
    Clock,
    Decision,
    Diagnostics,
    Fallback,
    Horizon,
    PlanColumns,
    Preview,
    VehicleState,
    still_horizon,
)
from colibri.autopilot.control.lpv_mpc import compromise, planning
from colibri.autopilot.control.lpv_mpc.approach import Approach
from colibri.autopilot.control.lpv_mpc.compromise import Deviation
from colibri.autopilot.control.lpv_mpc.model import RIGID, Disturbance
from colibri.autopilot.control.lpv_mpc.mpc import Mpc, Plan, PlanSettings, Qps, WeightSettings
from colibri.autopilot.control.lpv_mpc.path import PathSettings
from colibri.autopilot.control.lpv_mpc.planning import RECOVER_BEYOND, Now
from colibri.autopilot.control.lpv_mpc.targets import TargetBuilder, Wanted
from colibri.autopilot.control.parts.level import levelled, seen_level
from colibri.autopilot.control.parts.recovery import RecoverySettings, TurnGains, mix_with_priority, turning_moment
from colibri.autopilot.control.parts.riccati import gains
from colibri.autopilot.control.parts.thrust_force import ForceLimits
from colibri.autopilot.control.parts.vehicle_tracking import Tracked, VehicleTracker
from colibri.autopilot.control.scaling import scaled
from colibri.autopilot.control.settings import ControlInterval, QpSettings, interval_us
from colibri.autopilot.control.vehicle_model.disturbance_observer import MEASURED, ObserverSettings
from colibri.autopilot.control.vehicle_model.mass import MassSettings
from colibri.autopilot.control.vehicle_model.mixer import mixing_of
from colibri.common.config import Degrees, Negative, Positive, Table, read_settings
from colibri.common.elementary import cos, square, tan
from colibri.common.jit import opened, packed
from colibri.common.matrices import dot, matvec, norm
from colibri.common.records import Record, tuple_of
from colibri.common.rotations import nearest_turn, quaternion_from_euler, rotation_matrix
from colibri.common.types import Array
from colibri.plant.vehicle.description import AXES, Vehicle

_AS_PLANNED = cos(radians(15.0))  # no recovery from attitudes of the previous plan, within this angle
_NO_DISTURBANCE = Disturbance(np.zeros(3), np.zeros(3))
_UPSIDE_DOWN, _UNKNOWN = (0.0, 1.0, 0.0, 0.0), np.empty((0, 0))


class GuidanceSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Tracking of the references."""

    poles: tuple[Negative, Negative]
    approach_speed_m_s: Positive
    follow_within_m: Positive = 0.54
    max_acceleration_m_s2: Positive
    max_climb_m_s2: Positive | None = None
    """Largest upward acceleration of an approach; None: `max_acceleration_m_s2`."""
    exact_within_m: Positive = 0.3
    max_tilt_deg: Degrees
    min_thrust: Annotated[float, msgspec.Meta(gt=0.0, lt=1.0)]
    """Part of the weight."""


class FallbackSettings(RecoverySettings, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Fallbacks without a plan."""

    poles: tuple[Negative, Negative]


class LpvMpcSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The control law."""

    control_interval_s: ControlInterval
    observer: ObserverSettings
    mass: MassSettings
    qp: QpSettings
    guidance: GuidanceSettings
    plan: PlanSettings
    path: PathSettings
    weights: WeightSettings
    fallback: FallbackSettings


class LawMemory(Record, frozen=True):
    """State of the law between two control samples."""

    tracked: Tracked
    plan: Plan | None  # previous plan, if usable
    age: int  # samples since that plan
    lag_us: int  # of path time behind the clock
    deviation: Deviation | None = None


_Seen: TypeAlias = tuple[VehicleState, Tracked, float]
"""State now, in the level frame; what is tracked, with the rotors of a sample ago; largest speed now, see `actuate`."""


class LpvMpc(AttitudeController[LawMemory]):
    """The control law; its predicted outputs are `planning.PREDICTED`, then the squared speeds of the rotors."""

    reads_motion = False
    plan_columns = PlanColumns(6, 7, 8, 11)

    def __init__(self, table: Mapping[str, Any], vehicle: Vehicle, clock: Clock) -> None:
        settings = read_settings(scaled("lpv-mpc", table, vehicle), LpvMpcSettings)
        vehicle, self._to_body = levelled(vehicle)
        h = self._interval_s = settings.control_interval_s
        self.control_interval_us = interval_us(h)
        self.tracker = VehicleTracker(vehicle, settings.observer, settings.mass, h)
        self._shifted_samples, self._mixing = settings.fallback.shifted_samples, mixing_of(self.tracker.allocation)
        self._turn = TurnGains(settings.fallback.turn_1_s, settings.fallback.rate_1_s, settings.fallback.max_rate_rad_s)
        max_tilt_deg = settings.guidance.max_tilt_deg
        upright = max_tilt_deg < 90.0
        self.tilts_freely = not upright
        self._mpc = Mpc(settings.plan, settings.weights, vehicle, settings.qp.build(), h, clock, upright=upright)
        self.min_path_speed = settings.path.min_speed
        samples = ceil(settings.path.max_speed * (self._mpc.horizon + 2))
        self.preview = Preview(self.control_interval_us, samples if upright else max(samples, compromise.SAMPLES))
        span_n = float(self.tracker.allocation[0].sum())
        if vehicle.rotors.count > len(AXES):  # without moments
            span_n = min(span_n, 1.0 / float(self._mpc.from_wrench[:, 0].max()))
        hover_squared = vehicle.body.mass_kg * vehicle.gravity_m_s2 / span_n
        k1_s2, k2_s = gains(settings.guidance.poles)
        most_m_s2 = settings.guidance.max_acceleration_m_s2
        guidance = Approach(
            k1_s2,
            k2_s,
            settings.guidance.approach_speed_m_s * k2_s / k1_s2,
            settings.guidance.follow_within_m,
            most_m_s2,
            min(settings.guidance.max_climb_m_s2 or most_m_s2, most_m_s2),
            settings.guidance.exact_within_m,
            h,
            *gains(settings.fallback.poles),
            self._mpc.from_wrench,
            self._mpc.turns,
        )
        self._targets = TargetBuilder(guidance, settings.path, self._mpc)
        min_squared = square(self.tracker.lag.min_speed)
        min_n = span_n * min_squared
        min_up_n = max(settings.guidance.min_thrust * hover_squared * span_n, min_n)
        self._force = ForceLimits(upright, tan(radians(max_tilt_deg)), min_n, min_n, min_up_n)
        rigid, squared = np.empty(RIGID), np.empty(vehicle.rotors.count)
        limits = np.full((self._mpc.horizon, 2), min_squared)
        self._now = packed(Now(rigid, squared, _NO_DISTURBANCE, limits, self._force, span_n, hover_squared))
        arrays = opened(self._now, Now)
        self._arrays = arrays._replace(disturbance=Disturbance(*arrays.disturbance))

    @property
    def shows_plan(self) -> bool:
        return self._mpc.motion_steps > self._mpc.horizon

    @shows_plan.setter
    def shows_plan(self, shows: bool) -> None:
        """Without it, a plan's motion is computed only as far as `_planned` needs it."""
        self._mpc.motion_steps = (
            self._mpc.horizon + 1 if shows else min(self._shifted_samples, self._mpc.horizon - 1) + 2
        )

    def warm_up(self) -> None:
        """Load compiled code by a step for an attitude, and three from hover, the last upside down."""
        memory, references = self.initial(self.tracker.vehicle.hover_speed), still_horizon(self.preview.samples)
        level, _, _, _, _, no_thrust, _, _ = references
        self.step_attitude(memory, 0, AT_REST, AttitudeDemand(level, level, no_thrust))
        for attitude in (AT_REST.attitude, AT_REST.attitude, _UPSIDE_DOWN):
            memory, _ = self.step(memory, 0, AT_REST._replace(attitude=attitude), references)
        self._mpc.warm_up()

    def initial(self, rotor_speed: float) -> LawMemory:
        return LawMemory(self.tracker.initial(rotor_speed), None, 0, 0)

    def charge_ah(self, memory: LawMemory) -> float:
        return memory.tracked.charge_ah

    def with_charge(self, memory: LawMemory, charge_ah: float) -> LawMemory:
        return memory._replace(tracked=memory.tracked._replace(charge_ah=charge_ah))

    def mass_kg(self, memory: LawMemory) -> float:
        return memory.tracked.mass_kg

    def with_mass(self, memory: LawMemory, mass_kg: float) -> LawMemory:
        return memory._replace(tracked=memory.tracked._replace(mass_kg=mass_kg))

    def lag_us(self, memory: LawMemory) -> int:
        return memory.lag_us

    def path_speed(self, memory: LawMemory) -> float:
        plan = memory.plan
        return 1.0 if plan is None or plan.speeds is None else float(plan.speeds[memory.age])

    def with_lag(self, memory: LawMemory, lag_us: int) -> LawMemory:
        return memory._replace(lag_us=lag_us)

    def step(
        self, memory: LawMemory, time_us: int, state: VehicleState, references: Horizon
    ) -> tuple[LawMemory, Decision]:
        del time_us
        if not self._force.upright:
            seen = self._observe(memory, state)
            wanted = self._targets.within_thrust(self._now, references, memory.deviation)
            return self._decide(memory, seen, wanted, self._mpc.on_clock)
        state, inputs = self._inputs(memory, state)
        p, v, a, _, _, yaw, _, _ = references
        last, targets, qps = memory.plan.commands if memory.plan else _UNKNOWN, self._targets, self._mpc.on_clock
        begun, aim = planning.begin_by_clock(p, v, a, yaw, targets.law, targets.record, qps.kind, last, *inputs)
        seen = _seen(memory, state, inputs, begun)
        return self._decide(memory, seen, Wanted(targets.record, aim), qps, condensed=True)

    def step_on_path(
        self, memory: LawMemory, time_us: int, state: VehicleState, references: Horizon
    ) -> tuple[LawMemory, Decision]:
        del time_us
        seen = self._observe(memory, state)
        kept = memory.plan.speeds if memory.plan else None
        last = None if kept is None else kept[memory.age :]
        wanted = self._targets.on_path(self._now, self._opened_now(), references, last, memory.lag_us * 1e-6)
        return self._decide(memory, seen, wanted, self._mpc.on_path)

    def step_attitude(
        self, memory: LawMemory, time_us: int, state: VehicleState, demand: AttitudeDemand
    ) -> tuple[LawMemory, Decision]:
        del time_us
        seen = self._observe(memory, state)
        wanted = self._targets.of_demand(self._now, self._opened_now(), demand)
        return self._decide(memory, seen, wanted, self._mpc.on_hold)

    def _observe(self, memory: LawMemory, state: VehicleState) -> _Seen:
        """Observe the vehicle, and fill the start of a plan."""
        state, inputs = self._inputs(memory, state)
        return _seen(memory, state, inputs, planning.begin(*inputs))

    def _inputs(self, memory: LawMemory, state: VehicleState) -> tuple[VehicleState, tuple[Any, ...]]:
        """Return the state in the level frame, and the arguments of `planning.begin`."""
        tracked, plan = memory.tracked, memory.plan
        if self._to_body is not None:
            state = seen_level(state, self._to_body)
        position, velocity, attitude, _, rate, _, _, airborne = state
        return state, (
            position, velocity, attitude, rate, tracked.rotors, tracked.measured, tracked.estimate, tracked.mass_kg,
            tracked.charge_ah, airborne, _UNKNOWN if plan is None else plan.states, memory.age, self.tracker.model,
            self.tracker.battery.numbers, self._now, self._mpc.model, np.empty(MEASURED),
            np.empty(tracked.estimate.size),
        )  # fmt: skip

    def _opened_now(self) -> Now:
        return self._arrays._replace(force=self._force._replace(max_n=self._now["force"]["max_n"].item()))

    def _decide(
        self, memory: LawMemory, seen: _Seen, wanted: Wanted, qps: Qps, *, condensed: bool = False
    ) -> tuple[LawMemory, Decision]:
        """Decide by a plan, or without one by a fallback; the QP is `condensed` unless recovery may be needed."""
        (state, tracked, max_speed), path = seen, wanted.path
        before, age, lag_us = memory.plan, memory.age, memory.lag_us
        along_n, force_n, phi, theta, psi = wanted.aim
        yaw, mass_kg, path_lag_s = state.euler[2], tracked.mass_kg, lag_us * 1e-6 if path else nan
        plan: Plan | None = None
        turned_away = along_n < RECOVER_BEYOND * force_n
        recovers = turned_away and not _planned(memory, tracked.measured)
        if recovers:
            how = Diagnostics(mass_kg=mass_kg, path_lag_s=path_lag_s)
        else:
            if turned_away or not condensed:
                last = before.commands[age:] if before else _UNKNOWN
                self._mpc.condense(qps, self._now, wanted.target, last, along_n, state.airborne, path)
            plan, how = self._mpc.plan(qps, yaw, path, mass_kg, path_lag_s)
        if plan is not None:
            squared, age = plan.commands[0], 1
        elif before is not None and not recovers and age <= min(self._shifted_samples, self._mpc.horizon - 1):
            squared, plan, age = before.commands[age], before, age + 1
            how = how._replace(fallback=Fallback.SHIFTED_PLAN)
        else:
            squared, age, how = self._recover(tracked.measured), 0, how._replace(fallback=Fallback.RECOVERY)
        commands, tracked = self.tracker.actuate(tracked, squared, max_speed)
        lag_us = self._lag_us(lag_us, plan, age) if path else 0
        memory = LawMemory(tracked, plan, age, lag_us, wanted.deviation)
        return memory, tuple_of(Decision, (commands, (phi, theta, nearest_turn(psi, yaw)), how))

    def _lag_us(self, lag_us: int, plan: Plan | None, age: int) -> int:
        if plan is None or plan.speeds is None:
            return lag_us
        passed_s = 0.5 * self._interval_s * float(plan.speeds[age - 1] + plan.speeds[age])
        return max(lag_us + self.control_interval_us - round(passed_s * 1e6), 0)

    def _recover(self, measured: Array) -> Array:
        """Return squared speeds that turn the thrust axis to the force the shortest way."""
        force, rates = self._targets.force, self._arrays.rigid[10:]
        rotation = np.array(rotation_matrix(tuple(self._arrays.rigid[6:10].tolist())))
        moments = turning_moment(matvec(rotation.T, force / norm(force)), rates, self.tracker.inertia, self._turn)
        thrust_n = max(dot(force, measured[6:]), 0.0)
        squared: Array = mix_with_priority(thrust_n, moments, self._mixing, *self._arrays.limits[0].tolist())
        return squared


def _seen(memory: LawMemory, state: VehicleState, inputs: tuple[Any, ...], begun: tuple[float, float, float]) -> _Seen:
    (*_, measured, estimate), (charge_ah, mass_kg, max_speed) = inputs, begun
    return state, Tracked(memory.tracked.rotors, measured, estimate, charge_ah, mass_kg), max_speed


def _planned(memory: LawMemory, measured: Array) -> bool:
    if memory.plan is None:
        return False
    planned = rotation_matrix(quaternion_from_euler(*memory.plan.states[memory.age, 6:9].tolist()))
    return dot(np.array([row[2] for row in planned]), measured[6:]) > _AS_PLANNED
