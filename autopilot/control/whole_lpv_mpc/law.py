"""The whole-vehicle LPV-MPC as a control law: references, observers, battery and fallbacks about one plan."""

from collections.abc import Mapping
from math import ceil, radians
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
from colibri.autopilot.control.parts import recovery
from colibri.autopilot.control.parts.error_dynamics import error_transition
from colibri.autopilot.control.qp import QpSolver
from colibri.autopilot.control.settings import ControlInterval, QpSettings, interval_us
from colibri.autopilot.control.vehicle_model import disturbance_observer, rotor_lag
from colibri.autopilot.control.vehicle_model.airframe import drag_force
from colibri.autopilot.control.vehicle_model.battery import BatteryModel
from colibri.autopilot.control.vehicle_model.disturbance_observer import ObserverSettings, observer_of
from colibri.autopilot.control.vehicle_model.mass import MassSettings, follow_mass, mass_model
from colibri.autopilot.control.whole_lpv_mpc.feed_forward import ForceLimits, Guidance
from colibri.autopilot.control.whole_lpv_mpc.model import ROTORS, Disturbance
from colibri.autopilot.control.whole_lpv_mpc.mpc import Plan, PlanSettings, WeightSettings, WholeMpc
from colibri.autopilot.control.whole_lpv_mpc.path import PathSettings
from colibri.autopilot.control.whole_lpv_mpc.planning import Now
from colibri.autopilot.control.whole_lpv_mpc.targets import TargetBuilder, Wanted
from colibri.common.config import Count, Degrees, Negative, Positive, Table, read_settings
from colibri.common.elementary import cos, square, tan
from colibri.common.jit import packed
from colibri.common.kernels import asin, atan2
from colibri.common.matrices import dot, matvec, norm
from colibri.common.rotations import quaternion_from_euler, rotation_matrix
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle

_RECOVER_BEYOND = cos(radians(75.0))
"""A thrust axis further from where it must point is for the recovery law."""
_AS_PLANNED = cos(radians(15.0))
"""Unless the last plan has led there, to within this."""
_SHARES, _ALWAYS, _LIMITED_STEPS = 3.0, 0.5, 3
"""At first, no rotor has more than so many shares of the thrust that must point along its axis, or than such a part of
its share in hover: where little thrust is to be made, moments must not make much of it. A vehicle that stands, and does
not know it, would be tipped over by the moments that it takes for a disturbance."""
_NOWHERE = (0.0, 0.0, 0.0)


class GuidanceSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What of the references is followed."""

    poles: tuple[Negative, Negative]
    approach_speed_m_s: Positive
    exact_within_m: Positive
    max_tilt_deg: Degrees
    min_thrust: Annotated[float, msgspec.Meta(gt=0.0, lt=1.0)]
    """Part of the weight."""


class FallbackSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What flies when no plan can be had."""

    shifted_samples: Count
    poles: tuple[Negative, Negative]
    turn_1_s: Positive
    rate_1_s: Positive
    max_rate_rad_s: Positive


class WholeLpvMpcSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The control law."""

    control_interval_s: ControlInterval
    guidance: GuidanceSettings
    observer: ObserverSettings
    mass: MassSettings
    plan: PlanSettings
    path: PathSettings
    weights: WeightSettings
    fallback: FallbackSettings
    qp: QpSettings


class Memory(NamedTuple):
    """What the law carries from one control sample to the next.

    Attributes:
        speeds: Rotor speeds now, as the lag has them, parts of the largest, (4,).
        wrench, mean_wrench: U1, N, and U2..U4, N m, now, and over the interval that ends now, (4,) each.
        measured: What the observer measured a sample ago, (9,); None before the first.
        estimate: Of the observer a sample ago, (12,).
        charge_ah: Charge taken from the battery.
        mass_kg: That the vehicle moves like.
        plan: The last plan, made `age` samples ago; None where there is none to build on.
        age: Samples since that plan.
        lag_us: By which path time is behind the clock, µs.
    """

    speeds: Array
    wrench: Array
    mean_wrench: Array
    measured: Array | None
    estimate: Array
    charge_ah: float
    mass_kg: float
    plan: Plan | None
    age: int
    lag_us: int


class Inputs(NamedTuple):
    """What a decision begins with.

    Attributes:
        rotation: Body to earth, (3, 3).
        measured, estimate: Of the observer, (9,) and (12,).
        mass_kg: That the vehicle moves like.
        now: For the plan.
        limits: Of the force.
    """

    rotation: Array
    measured: Array
    estimate: Array
    mass_kg: float
    now: Now
    limits: ForceLimits


class WholeLpvMpc:
    """The control law. Its predicted outputs are those of `condensing.PREDICTED`.

    Attributes:
        control_interval_us: The control sample.
        preview: From now to one sample past the horizon.
        min_path_speed: The least speed along the references, in parts of their own.
        plan_columns: Of the attitude in its predicted outputs.
    """

    plan_columns = PlanColumns(6, 7, 8, 11)

    def __init__(self, table: Mapping[str, Any], vehicle: Vehicle, clock: Clock) -> None:
        """Control `vehicle` as the profile's `table` says; `clock` only measures.

        Raises:
            SettingsError: The table is wrong.
            SolverError: The solver cannot be used.
        """
        settings = read_settings(table, WholeLpvMpcSettings)
        self._interval_s = h = settings.control_interval_s
        self.control_interval_us = interval_us(h)
        self._vehicle = vehicle
        self._lag = rotor_lag.rotor_lag(vehicle, h)
        self._battery = BatteryModel(vehicle)
        solver = QpSolver(settings.qp.solver, settings.qp.tolerance, settings.qp.max_iterations)
        self._mpc = WholeMpc(settings.plan, settings.weights, vehicle, solver, h, clock)
        self.min_path_speed = settings.path.min_speed
        samples = self._mpc.horizon + 2
        self.preview = Preview(self.control_interval_us, ceil(settings.path.max_speed * samples))
        self._fallback = settings.fallback
        self._observer = observer_of(settings.observer, vehicle, h)
        self._packed_observer = packed(self._observer)
        self._packed_mass = packed(mass_model(settings.mass, vehicle, h))
        self._allocation = vehicle.allocation() * square(vehicle.rotors.max_speed)
        self._momentum = vehicle.rotor_momentum() * vehicle.rotors.max_speed
        self._span_n = float(self._allocation[0].sum())
        self._hover_squared = vehicle.body.mass_kg * vehicle.gravity_m_s2 / self._span_n
        k1_s2, k2_s = gains(settings.guidance.poles)
        guidance = Guidance(
            k1_s2,
            k2_s,
            error_transition(settings.guidance.poles, h, samples),
            settings.guidance.approach_speed_m_s * k2_s / k1_s2,
            settings.guidance.exact_within_m,
            h,
            *gains(settings.fallback.poles),
            self._mpc.from_wrench,
        )
        self._targets = TargetBuilder(guidance, settings.path, self._mpc)
        self._tilt_tangent = tan(radians(settings.guidance.max_tilt_deg))
        self._min_up_n = settings.guidance.min_thrust * self._hover_squared * self._span_n
        self._turn = recovery.TurnGains(
            settings.fallback.turn_1_s, settings.fallback.rate_1_s, settings.fallback.max_rate_rad_s
        )

    def warm_up(self) -> None:
        """Load what is compiled: three steps from hover, the last of them upside down."""
        n = self.preview.samples
        still, level = np.zeros((n, 3)), np.zeros(n)
        references = Horizon(still, still, still, still, still, level, level, level)
        memory = self.initial(self._vehicle.hover_speed)
        for attitude in ((1.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0)):
            state = VehicleState(_NOWHERE, _NOWHERE, attitude, _NOWHERE, _NOWHERE)
            memory, _ = self.step(memory, 0, state, references)
        self.step_attitude(
            memory, 0, state._replace(attitude=(1.0, 0.0, 0.0, 0.0)), AttitudeDemand(still, still, level)
        )

    def initial(self, rotor_speed: float) -> Memory:
        """Return the memory of a law whose rotors all turn at `rotor_speed` (the vehicle's unit)."""
        speeds = np.full(ROTORS, rotor_speed / self._vehicle.rotors.max_speed)
        wrench = matvec(self._allocation, speeds * speeds)
        estimate = np.zeros(disturbance_observer.ESTIMATES)
        return Memory(speeds, wrench, wrench, None, estimate, 0.0, self._vehicle.body.mass_kg, None, 0, 0)

    def charge_ah(self, memory: Memory) -> float:
        """Return the charge taken from the battery, Ah."""
        return memory.charge_ah

    def with_charge(self, memory: Memory, charge_ah: float) -> Memory:
        """Return the memory with another charge taken from the battery, Ah."""
        return memory._replace(charge_ah=charge_ah)

    def mass_kg(self, memory: Memory) -> float:
        """Return the mass that the vehicle moves like."""
        return memory.mass_kg

    def with_mass(self, memory: Memory, mass_kg: float) -> Memory:
        """Return the memory with another mass."""
        return memory._replace(mass_kg=mass_kg)

    def lag_us(self, memory: Memory) -> int:
        """Return by how much path time is behind the clock, µs."""
        return memory.lag_us

    def path_speed(self, memory: Memory) -> float:
        """Return the speed along the references, in parts of their own."""
        plan = memory.plan
        return 1.0 if plan is None or plan.speeds is None else float(plan.speeds[memory.age])

    def with_lag(self, memory: Memory, lag_us: int) -> Memory:
        """Return the memory with another lag, µs."""
        return memory._replace(lag_us=lag_us)

    def step(self, memory: Memory, time_us: int, state: VehicleState, references: Horizon) -> tuple[Memory, Decision]:
        """Decide the rotor speeds to hold until the next control sample."""
        del time_us
        inputs = self._inputs(memory, state)
        return self._decide(memory, inputs, self._targets.on_clock(inputs.now, inputs.limits, references))

    def step_on_path(
        self, memory: Memory, time_us: int, state: VehicleState, references: Horizon
    ) -> tuple[Memory, Decision]:
        """Decide the same, and the speed along the references."""
        del time_us
        inputs = self._inputs(memory, state)
        kept = memory.plan.speeds if memory.plan else None
        last = None if kept is None else kept[memory.age :]
        wanted = self._targets.on_path(inputs.now, inputs.limits, references, last, memory.lag_us * 1e-6)
        return self._decide(memory, inputs, wanted)

    def step_attitude(
        self, memory: Memory, time_us: int, state: VehicleState, demand: AttitudeDemand
    ) -> tuple[Memory, Decision]:
        """Decide the same for an attitude and a thrust, which is kept within what the rotors can make."""
        del time_us
        inputs = self._inputs(memory, state)
        wanted = self._targets.of_demand(inputs.now, inputs.limits, demand)
        return self._decide(memory, inputs, wanted, on_track=False)

    def _inputs(self, memory: Memory, state: VehicleState) -> Inputs:
        rotation = np.array(rotation_matrix(state.attitude))
        measured = np.array([*state.velocity_enu_m_s, *state.rate_flu_rad_s, *rotation[:, 2].tolist()])
        estimate, mass_kg = self._estimate(memory, measured), memory.mass_kg
        if state.airborne:
            mass_kg = follow_mass(mass_kg, estimate[6:], measured[6:], float(memory.wrench[0]), self._packed_mass)
        self._mpc.model["airframe"]["mass_kg"] = mass_kg
        squared = memory.speeds * memory.speeds
        rigid = np.array([*state.position_enu_m, *state.velocity_enu_m_s, *state.attitude, *state.rate_flu_rad_s])
        min_squared = square(self._lag.min_speed)
        limits = np.empty((self._mpc.horizon, 2))
        limits[:, 0] = min_squared
        expected = memory.plan.states[memory.age :, 12:] if memory.plan else squared[None, :]
        self._battery.limit_squared(memory.charge_ah, expected, limits[:, 1])
        now = Now(rigid, float(state.euler[2]), squared, Disturbance(estimate[6:9], estimate[9:]), limits)
        max_squared = square(self._battery.max_common_speed(memory.charge_ah))
        min_n, max_n = self._span_n * min_squared, self._span_n * max_squared
        force = ForceLimits(self._tilt_tangent, min_n, max_n, max(self._min_up_n, min_n))
        return Inputs(rotation, measured, estimate, mass_kg, now, force)

    def _estimate(self, memory: Memory, measured: Array) -> Array:
        """Return the observer's estimate, (12,), with the measurement `measured`, (9,)."""
        if memory.measured is None:
            return disturbance_observer.first_estimate(measured)
        middle = 0.5 * (memory.measured + measured)
        drag = np.empty(3)
        drag_force(self._observer.airframe, middle[:3], middle[6:], float(memory.mean_wrench[0]), drag)
        momentum = dot(self._momentum, memory.speeds)
        return disturbance_observer.observe(
            memory.estimate,
            memory.measured,
            measured,
            memory.mean_wrench,
            momentum,
            drag,
            memory.mass_kg,
            self._packed_observer,
        )

    def _decide(
        self, memory: Memory, inputs: Inputs, wanted: Wanted, *, on_track: bool = True
    ) -> tuple[Memory, Decision]:
        squared, plan, age, diagnostics = self._choose(memory, inputs, wanted, on_track=on_track)
        max_speed = self._battery.max_speed_now(memory.charge_ah, memory.speeds)
        commands, speeds, wrench, mean_wrench = rotor_lag.actuate(
            memory.speeds, squared, self._lag, max_speed, self._allocation
        )
        charge_ah = self._battery.charge_after(memory.charge_ah, memory.speeds, self._interval_s)
        lag_us = self._lag_us(memory.lag_us, plan, age) if wanted.path else 0
        after = Memory(
            speeds,
            wrench,
            mean_wrench,
            inputs.measured,
            inputs.estimate,
            charge_ah,
            inputs.mass_kg,
            plan,
            age,
            lag_us,
        )
        R = wanted.target.attitudes[0]
        angles = (atan2(R[2, 1], R[2, 2]), -asin(min(max(R[2, 0], -1.0), 1.0)), float(wanted.target.yaw_rad[0]))
        how = diagnostics._replace(mass_kg=inputs.mass_kg)
        if wanted.path:
            how = how._replace(path_lag_s=memory.lag_us * 1e-6)
        return after, Decision(commands * self._vehicle.rotors.max_speed, angles, how)

    def _lag_us(self, lag_us: int, plan: Plan | None, age: int) -> int:
        """Return the lag a sample later, on a plan that is so old then."""
        if plan is None or plan.speeds is None:
            return lag_us
        passed_s = 0.5 * self._interval_s * float(plan.speeds[age - 1] + plan.speeds[age])
        return max(lag_us + self.control_interval_us - round(passed_s * 1e6), 0)

    def _choose(
        self, memory: Memory, inputs: Inputs, wanted: Wanted, *, on_track: bool
    ) -> tuple[Array, Plan | None, int, Diagnostics]:
        """Plan, or fall back: return squared rotor speeds, the plan to go on with, its age, and how it came about."""
        target, force, path = wanted
        along_n = dot(force, inputs.rotation[:, 2].copy())
        if along_n < _RECOVER_BEYOND * norm(force) and not _planned(memory, inputs):
            return self._recover(inputs, force, Diagnostics())
        most = max(_SHARES * along_n / self._span_n, _ALWAYS * self._hover_squared)
        at_first = inputs.now.limits[:_LIMITED_STEPS, 1]
        np.minimum(at_first, most, out=at_first)
        last = memory.plan.commands[memory.age :] if memory.plan else None
        plan, diagnostics = self._mpc.plan(inputs.now, target, last, path, on_track=on_track)
        if plan is not None:
            return plan.commands[0], plan, 1, diagnostics
        if memory.plan is not None and memory.age <= min(self._fallback.shifted_samples, self._mpc.horizon - 1):
            how = diagnostics._replace(fallback=Fallback.SHIFTED_PLAN)
            return memory.plan.commands[memory.age], memory.plan, memory.age + 1, how
        return self._recover(inputs, force, diagnostics)

    def _recover(
        self, inputs: Inputs, force: Array, diagnostics: Diagnostics
    ) -> tuple[Array, Plan | None, int, Diagnostics]:
        """Turn the thrust axis the shortest way to where it must point; thrust as far as it points there."""
        direction = matvec(inputs.rotation.T, force / norm(force))
        rates = inputs.now.rigid[10:]
        moments = recovery.turning_moment(direction, rates, self._observer.inertia, self._turn)
        thrust_n = max(dot(force, inputs.rotation[:, 2].copy()), 0.0)
        from_wrench, (least, most) = self._mpc.from_wrench, inputs.now.limits[0].tolist()
        squared = recovery.mix_with_priority(
            thrust_n, moments, from_wrench[:, 0].copy(), from_wrench[:, 1:].copy(), least, most
        )
        return squared, None, 0, diagnostics._replace(fallback=Fallback.RECOVERY)


def _planned(memory: Memory, inputs: Inputs) -> bool:
    """Whether the last plan leads to the attitude now."""
    if memory.plan is None:
        return False
    planned = rotation_matrix(quaternion_from_euler(*memory.plan.states[memory.age, 6:9].tolist()))
    return dot(np.array([row[2] for row in planned]), inputs.rotation[:, 2].copy()) > _AS_PLANNED


def gains(poles: tuple[float, float]) -> tuple[float, float]:
    """Return the gains on an error, 1/s², and on its rate, 1/s, by which it dies with these poles, 1/s."""
    first, second = poles
    return first * second, -(first + second)
