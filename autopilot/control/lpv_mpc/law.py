"""The `lpv-mpc` control law: position by feedback linearisation, attitude by LPV-MPC."""

from collections.abc import Mapping
from math import radians
from typing import Annotated, Any, NamedTuple

import msgspec
import numpy as np

from colibri.autopilot.control.interface import (
    AttitudeDemand,
    Clock,
    Decision,
    Diagnostics,
    Fallback,
    Horizon,
    PlanColumns,
    Preview,
    VehicleState,
)
from colibri.autopilot.control.lpv_mpc import prediction
from colibri.autopilot.control.lpv_mpc.attitude_mpc import AttitudeMpc, AttitudeSettings, Plan
from colibri.autopilot.control.lpv_mpc.condensing import Target
from colibri.autopilot.control.lpv_mpc.outer_loop import GuidanceSettings, OuterLoop, Setpoint
from colibri.autopilot.control.lpv_mpc.position_loop import Motion
from colibri.autopilot.control.lpv_mpc.prediction import InitialState
from colibri.autopilot.control.parts.recovery import RecoverySettings, mix_with_priority
from colibri.autopilot.control.parts.tracking_law import TrackingLaw, TrackingSettings
from colibri.autopilot.control.parts.vehicle_tracking import Observed, Tracked
from colibri.common.config import Count, read_settings
from colibri.common.elementary import square
from colibri.common.kernels import cos
from colibri.common.matrices import dot, matvec
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle

_RECOVER_BEYOND = cos(radians(75.0))  # recovery from a larger error of the thrust axis, or a steeper pitch
_NO_YAW = np.empty(0)


class FallbackSettings(RecoverySettings, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Fallbacks without a plan: the previous plan, then an LQR, then a descent."""

    lqr_samples: Count
    descent_thrust: Annotated[float, msgspec.Meta(gt=0.0, lt=1.0)]


class LpvMpcSettings(TrackingSettings, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The control law."""

    guidance: GuidanceSettings
    attitude: AttitudeSettings
    fallback: FallbackSettings


class Memory(NamedTuple):
    """State of the law between two control samples."""

    tracked: Tracked
    moments: Array  # U2..U4 last commanded, N m, (3,)
    plan: Plan | None  # previous plan, if usable
    age: int  # samples since that plan


class LawInputs(NamedTuple):
    """Inputs of a decision."""

    observed: Observed
    now: InitialState  # for the attitude MPC
    motion: Motion  # for the outer loop


class Choice(NamedTuple):
    """A plan or a fallback."""

    squared: Array  # rotor speeds, parts of the largest, (4,)
    moments: Array
    plan: Plan | None
    age: int
    diagnostics: Diagnostics


class LpvMpc(TrackingLaw[Memory]):
    """The control law; its predicted outputs are the states of `prediction`."""

    plan_columns = PlanColumns(prediction.PHI, prediction.THETA, prediction.PSI, prediction.R)

    def __init__(self, table: Mapping[str, Any], vehicle: Vehicle, clock: Clock) -> None:
        settings = read_settings(table, LpvMpcSettings)
        super().__init__(settings, settings.fallback, vehicle)
        self._lqr_samples, self._descent_thrust = settings.fallback.lqr_samples, settings.fallback.descent_thrust
        interval_s, lag = self._interval_s, self.tracker.lag
        self._attitude = AttitudeMpc(settings.attitude, vehicle, lag, settings.qp.build(), interval_s, clock)
        self.preview = Preview(self.control_interval_us, self._attitude.horizon + 2)
        self._outer_loop = OuterLoop(settings.guidance, vehicle, lag, interval_s, self._attitude.horizon)

    def initial(self, rotor_speed: float) -> Memory:
        tracked = self.tracker.initial(rotor_speed)
        return Memory(tracked, tracked.wrench[1:].copy(), None, 0)

    def step(self, memory: Memory, time_us: int, state: VehicleState, references: Horizon) -> tuple[Memory, Decision]:
        del time_us
        inputs = self._inputs(memory, state)
        planned_yaw = memory.plan.states[memory.age :, prediction.PSI].copy() if memory.plan else _NO_YAW
        max_speed = self.tracker.battery.max_common_speed(memory.tracked.charge_ah)
        disturbances = inputs.observed.estimate[6:]
        setpoint = self._outer_loop.track(inputs.motion, references, planned_yaw, disturbances, max_speed)
        return self._decide(memory, inputs, setpoint)

    def step_attitude(
        self, memory: Memory, time_us: int, state: VehicleState, demand: AttitudeDemand
    ) -> tuple[Memory, Decision]:
        del time_us
        inputs = self._inputs(memory, state)
        max_speed = self.tracker.battery.max_common_speed(memory.tracked.charge_ah)
        setpoint = self._outer_loop.hold(inputs.motion, demand, inputs.now.disturbance_n_m, max_speed)
        return self._decide(memory, inputs, setpoint)

    def _inputs(self, memory: Memory, state: VehicleState) -> LawInputs:
        tracked, tracker = memory.tracked, self.tracker
        observed = tracker.observe(tracked, state)
        phi, theta, psi = state.euler
        p, q, r = state.rate_flu_rad_s
        thrust_n, *moments_n_m = tracked.wrench.tolist()
        x = np.array((phi, p, theta, q, psi, r, *moments_n_m))
        momentum = dot(tracker.momentum, tracked.speeds)
        _, _, measured, estimate, mass_kg, max_speed, _ = observed
        now = InitialState(x, memory.moments, estimate[9:], momentum, max_speed)
        motion = Motion(np.array(state.position_enu_m), measured[:3], measured[6:], float(psi), thrust_n, mass_kg)
        return LawInputs(observed, now, motion)

    def _decide(self, memory: Memory, inputs: LawInputs, setpoint: Setpoint) -> tuple[Memory, Decision]:
        squared, moments, plan, age, diagnostics = self._choose(memory, inputs, setpoint)
        observed = inputs.observed
        commands, tracked = self.tracker.actuate(memory.tracked, observed, squared)
        phi, theta, psi = setpoint.target.angles[0].tolist()
        how = diagnostics._replace(mass_kg=observed.mass_kg)
        return Memory(tracked, moments, plan, age), Decision(commands, (phi, theta, psi), how)

    def _choose(self, memory: Memory, inputs: LawInputs, setpoint: Setpoint) -> Choice:
        target, now, rotation = setpoint.target, inputs.now, inputs.observed.rotation
        steep = square(float(rotation[2, 0])) > 1.0 - square(_RECOVER_BEYOND)
        if steep or setpoint.aligned < _RECOVER_BEYOND:
            from_wrench, least = self._attitude.from_wrench, self._attitude.problem.min_squared
            squared = self.recovered(setpoint.force, inputs.observed, from_wrench, least, square(now.max_speed))
            moments = matvec(self.tracker.allocation[1:], squared)
            return Choice(squared, moments, None, 1, Diagnostics(fallback=Fallback.RECOVERY))
        ahead = memory.plan.states[memory.age + 1 :] if memory.plan else None
        plan, diagnostics = self._attitude.plan(now, target, ahead)
        if plan is not None:
            assert diagnostics.planned_squared is not None, "a plan has its commands"
            return Choice(diagnostics.planned_squared[0], plan.moments[0], plan, 1, diagnostics)
        age = memory.age + 1
        if memory.plan is not None and memory.age <= min(self._fallback.shifted_samples, self._attitude.horizon - 1):
            moments = memory.plan.moments[memory.age]
            how = diagnostics._replace(fallback=Fallback.SHIFTED_PLAN)
            return Choice(self._mixed(float(target.thrust_n[0]), moments, now), moments, memory.plan, age, how)
        if memory.age <= self._fallback.shifted_samples + self._lqr_samples:
            moments = self._attitude.lqr(now, target)
            how = diagnostics._replace(fallback=Fallback.LQR)
            return Choice(self._mixed(float(target.thrust_n[0]), moments, now), moments, None, age, how)
        return self._descend(inputs, age, diagnostics)

    def _descend(self, inputs: LawInputs, age: int, diagnostics: Diagnostics) -> Choice:
        now = inputs.now
        end = np.zeros(prediction.STATES + prediction.INPUTS)
        end[prediction.PSI] = now.x[prediction.PSI]
        end[9:] = end[6:9] = -now.disturbance_n_m
        level = Target(end[None, [0, 2, 4]], end, np.zeros(1))
        moments = self._attitude.lqr(now, level)
        weight_n = inputs.observed.mass_kg * self.tracker.vehicle.gravity_m_s2
        how = diagnostics._replace(fallback=Fallback.DESCENT)
        squared = self._mixed(weight_n * self._descent_thrust, moments, now)
        return Choice(squared, moments, None, age, how)

    def _mixed(self, thrust_n: float, moments: Array, now: InitialState) -> Array:
        problem, maximum = self._attitude.problem, square(now.max_speed)
        return mix_with_priority(
            thrust_n, moments, problem.from_thrust, problem.from_moments, problem.min_squared, maximum
        )
