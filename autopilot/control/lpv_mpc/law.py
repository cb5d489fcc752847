"""The flight profile's control law: position by feedback linearisation with preview, attitude by LPV-MPC."""

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
from colibri.autopilot.control.lpv_mpc import position_loop, prediction
from colibri.autopilot.control.lpv_mpc.attitude_mpc import AttitudeMpc, AttitudeSettings, Plan
from colibri.autopilot.control.lpv_mpc.condensing import Target
from colibri.autopilot.control.lpv_mpc.outer_loop import GuidanceSettings, OuterLoop, Setpoint
from colibri.autopilot.control.lpv_mpc.position_loop import Motion
from colibri.autopilot.control.lpv_mpc.prediction import InitialState
from colibri.autopilot.control.parts import recovery
from colibri.autopilot.control.qp import QpSolver
from colibri.autopilot.control.settings import ControlInterval, QpSettings, interval_us
from colibri.autopilot.control.vehicle_model import disturbance_observer, rotor_lag
from colibri.autopilot.control.vehicle_model.airframe import drag_force
from colibri.autopilot.control.vehicle_model.battery import BatteryModel
from colibri.autopilot.control.vehicle_model.disturbance_observer import ObserverSettings, observer_of
from colibri.autopilot.control.vehicle_model.mass import MassSettings, follow_mass, mass_model
from colibri.common.config import Count, Positive, Table, read_settings
from colibri.common.elementary import square
from colibri.common.jit import packed
from colibri.common.kernels import cos
from colibri.common.matrices import dot, matvec
from colibri.common.rotations import rotation_matrix
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle

_RECOVER_BEYOND = cos(radians(75.0))
"""A thrust axis further from where it must point, or a steeper pitch, is for the recovery law."""
_NO_YAW = np.empty(0)
_NOWHERE = (0.0, 0.0, 0.0)


class FallbackSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What flies when no plan can be had."""

    shifted_samples: Count
    lqr_samples: Count
    descent_thrust: Annotated[float, msgspec.Meta(gt=0.0, lt=1.0)]
    turn_1_s: Positive
    rate_1_s: Positive
    max_rate_rad_s: Positive


class LpvMpcSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The control law."""

    control_interval_s: ControlInterval
    guidance: GuidanceSettings
    observer: ObserverSettings
    mass: MassSettings
    attitude: AttitudeSettings
    fallback: FallbackSettings
    qp: QpSettings


class Memory(NamedTuple):
    """What the law carries from one control sample to the next.

    Attributes:
        speeds: Rotor speeds now, as the lag has them, parts of the largest, (4,).
        moments: U2..U4 last commanded, N m, (3,).
        wrench, mean_wrench: U1..U4 now, and over the interval that ends now, (4,) each.
        measured: What the observer measured a sample ago, (9,); None before the first.
        estimate: Of the observer a sample ago, (12,).
        charge_ah: Charge taken from the battery.
        mass_kg: That the vehicle moves like.
        plan: The last plan, made `age` samples ago; None where there is none to build on.
        age: Samples since that plan.
    """

    speeds: Array
    moments: Array
    wrench: Array
    mean_wrench: Array
    measured: Array | None
    estimate: Array
    charge_ah: float
    mass_kg: float
    plan: Plan | None
    age: int


class LawInputs(NamedTuple):
    """What a decision begins with.

    Attributes:
        rotation: Body to earth, (3, 3).
        measured, estimate: Of the observer, (9,) and (12,).
        mass_kg: That the vehicle moves like.
        now, motion: For the attitude's plan, and for the outer loop.
    """

    rotation: Array
    measured: Array
    estimate: Array
    mass_kg: float
    now: InitialState
    motion: Motion


class Choice(NamedTuple):
    """What was chosen: squared rotor speeds (4,) in parts of the largest, their moments, and the plan to go on with."""

    squared: Array
    moments: Array
    plan: Plan | None
    age: int
    diagnostics: Diagnostics


class LpvMpc:
    """The control law. Its predicted outputs are the states of `prediction`.

    Attributes:
        control_interval_us: The control sample.
        preview: From now to one sample past the horizon.
        plan_columns: Of the attitude in its predicted outputs.
    """

    plan_columns = PlanColumns(prediction.PHI, prediction.THETA, prediction.PSI, prediction.R)

    def __init__(self, table: Mapping[str, Any], vehicle: Vehicle, clock: Clock) -> None:
        """Control `vehicle` as the profile's `table` says; `clock` only measures.

        Raises:
            SettingsError: The table is wrong.
            SolverError: The solver cannot be used.
        """
        settings = read_settings(table, LpvMpcSettings)
        self.control_interval_us = interval_us(settings.control_interval_s)
        self._interval_s = settings.control_interval_s
        self._vehicle = vehicle
        self._lag = rotor_lag.rotor_lag(vehicle, self._interval_s)
        self._battery = BatteryModel(vehicle)
        solver = QpSolver(settings.qp.solver, settings.qp.tolerance, settings.qp.max_iterations)
        self._attitude = AttitudeMpc(settings.attitude, vehicle, self._lag, solver, self._interval_s, clock)
        self.preview = Preview(self.control_interval_us, self._attitude.horizon + 2)
        self._outer_loop = OuterLoop(settings.guidance, vehicle, self._lag, self._interval_s, self._attitude.horizon)
        self._fallback = settings.fallback
        self._allocation = vehicle.allocation() * square(vehicle.rotors.max_speed)
        self._momentum = vehicle.rotor_momentum() * vehicle.rotors.max_speed
        self._observer = observer_of(settings.observer, vehicle, self._interval_s)
        self._packed_observer = packed(self._observer)
        self._packed_mass = packed(mass_model(settings.mass, vehicle, self._interval_s))
        self._turn = recovery.TurnGains(
            settings.fallback.turn_1_s, settings.fallback.rate_1_s, settings.fallback.max_rate_rad_s
        )

    def warm_up(self) -> None:
        """Load what is compiled: three steps from hover, the last of them upside down."""
        still = np.zeros((self.preview.samples, 3))
        level = np.zeros(self.preview.samples)
        references = Horizon(still, still, still, still, still, level, level, level)
        memory = self.initial(self._vehicle.hover_speed)
        for attitude in ((1.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0)):
            state = VehicleState(_NOWHERE, _NOWHERE, attitude, _NOWHERE, _NOWHERE)
            memory, _ = self.step(memory, 0, state, references)
        self.step_attitude(memory, 0, state, AttitudeDemand(still, still, level))

    def initial(self, rotor_speed: float) -> Memory:
        """Return the memory of a law whose rotors all turn at `rotor_speed` (the vehicle's unit)."""
        speeds = np.full(4, rotor_speed / self._vehicle.rotors.max_speed)
        wrench = matvec(self._allocation, speeds * speeds)
        estimate, mass_kg = np.zeros(disturbance_observer.ESTIMATES), self._vehicle.body.mass_kg
        return Memory(speeds, wrench[1:].copy(), wrench, wrench, None, estimate, 0.0, mass_kg, None, 0)

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

    def step(self, memory: Memory, time_us: int, state: VehicleState, references: Horizon) -> tuple[Memory, Decision]:
        """Decide the rotor speeds to hold until the next control sample."""
        del time_us
        inputs = self._inputs(memory, state)
        planned_yaw = memory.plan.states[memory.age :, prediction.PSI].copy() if memory.plan else _NO_YAW
        max_speed = self._battery.max_common_speed(memory.charge_ah)
        setpoint = self._outer_loop.track(inputs.motion, references, planned_yaw, inputs.estimate[6:], max_speed)
        return self._decide(memory, inputs, setpoint)

    def step_attitude(
        self, memory: Memory, time_us: int, state: VehicleState, demand: AttitudeDemand
    ) -> tuple[Memory, Decision]:
        """Decide the same for an attitude and a thrust, which is kept within what the rotors leave to the moments."""
        del time_us
        inputs = self._inputs(memory, state)
        max_speed = self._battery.max_common_speed(memory.charge_ah)
        setpoint = self._outer_loop.hold(inputs.motion, demand, inputs.now.disturbance_n_m, max_speed)
        return self._decide(memory, inputs, setpoint)

    def _inputs(self, memory: Memory, state: VehicleState) -> LawInputs:
        rotation = np.array(rotation_matrix(state.attitude))
        measured = np.array([*state.velocity_enu_m_s, *state.rate_flu_rad_s, *rotation[:, 2].tolist()])
        estimate = self.estimate(memory, measured)
        phi, theta, psi = state.euler
        p, q, r = state.rate_flu_rad_s
        thrust_n, *moments_n_m = memory.wrench.tolist()
        mass_kg = memory.mass_kg
        if state.airborne:
            mass_kg = follow_mass(mass_kg, estimate[6:], measured[6:], thrust_n, self._packed_mass)
        x = np.array((phi, p, theta, q, psi, r, *moments_n_m))
        momentum = dot(self._momentum, memory.speeds)
        max_speed = self._battery.max_speed_now(memory.charge_ah, memory.speeds)
        now = InitialState(x, memory.moments, estimate[9:], momentum, max_speed)
        motion = Motion(np.array(state.position_enu_m), measured[:3], measured[6:], float(psi), thrust_n, mass_kg)
        return LawInputs(rotation, measured, estimate, mass_kg, now, motion)

    def _decide(self, memory: Memory, inputs: LawInputs, setpoint: Setpoint) -> tuple[Memory, Decision]:
        choice = self._choose(memory, inputs, setpoint)
        commands, speeds, wrench, mean_wrench = rotor_lag.actuate(
            memory.speeds, choice.squared, self._lag, inputs.now.max_speed, self._allocation
        )
        charge_ah = self._battery.charge_after(memory.charge_ah, memory.speeds, self._interval_s)
        after = Memory(
            speeds,
            choice.moments,
            wrench,
            mean_wrench,
            inputs.measured,
            inputs.estimate,
            charge_ah,
            inputs.mass_kg,
            choice.plan,
            choice.age,
        )
        phi, theta, psi = setpoint.target.angles[0].tolist()
        how = choice.diagnostics._replace(mass_kg=inputs.mass_kg)
        return after, Decision(commands * self._vehicle.rotors.max_speed, (phi, theta, psi), how)

    def estimate(self, memory: Memory, measured: Array) -> Array:
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

    def _choose(self, memory: Memory, inputs: LawInputs, setpoint: Setpoint) -> Choice:
        """Plan; where that cannot be had, fall back."""
        target, now, rotation = setpoint.target, inputs.now, inputs.rotation
        steep = square(float(rotation[2, 0])) > 1.0 - square(_RECOVER_BEYOND)
        if steep or setpoint.aligned < _RECOVER_BEYOND:
            return self._recover(now, setpoint.force, rotation)
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
        if memory.age <= self._fallback.shifted_samples + self._fallback.lqr_samples:
            moments = self._attitude.lqr(now, target)
            how = diagnostics._replace(fallback=Fallback.LQR)
            return Choice(self._mixed(float(target.thrust_n[0]), moments, now), moments, None, age, how)
        return self._descend(inputs, age, diagnostics)

    def _recover(self, now: InitialState, force: Array, rotation: Array) -> Choice:
        """Turn the thrust axis the shortest way to where it must point; thrust as far as it points there."""
        direction = matvec(rotation.T, force / position_loop.length(force))
        moments = recovery.turning_moment(direction, now.x[list(prediction.RATES)], self._observer.inertia, self._turn)
        squared = self._mixed(max(dot(force, rotation[:, 2]), 0.0), moments, now)
        return Choice(squared, matvec(self._allocation[1:], squared), None, 1, Diagnostics(fallback=Fallback.RECOVERY))

    def _descend(self, inputs: LawInputs, age: int, diagnostics: Diagnostics) -> Choice:
        """Level and sink, the last resort."""
        now = inputs.now
        end = np.zeros(prediction.STATES + prediction.INPUTS)
        end[prediction.PSI] = now.x[prediction.PSI]
        end[9:] = end[6:9] = -now.disturbance_n_m
        level = Target(end[None, [0, 2, 4]], end, np.zeros(1))
        moments = self._attitude.lqr(now, level)
        weight_n = inputs.mass_kg * self._vehicle.gravity_m_s2
        how = diagnostics._replace(fallback=Fallback.DESCENT)
        squared = self._mixed(weight_n * self._fallback.descent_thrust, moments, now)
        return Choice(squared, moments, None, age, how)

    def _mixed(self, thrust_n: float, moments: Array, now: InitialState) -> Array:
        problem, maximum = self._attitude.problem, square(now.max_speed)
        return recovery.mix_with_priority(
            thrust_n, moments, problem.from_thrust, problem.from_moments, problem.min_squared, maximum
        )
