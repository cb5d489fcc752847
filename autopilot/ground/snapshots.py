"""Snapshots for telemetry."""

from math import isnan

import numpy as np

from colibri.autopilot.commander.fence import Fence
from colibri.autopilot.commander.mode_selection import ModeSelection
from colibri.autopilot.commander.pilot import Pilot
from colibri.autopilot.commander.rules.failsafe_table import Action
from colibri.autopilot.commander.rules.modes import Mode, custom_mode
from colibri.autopilot.control.interface import (
    FALLBACK_CODES,
    STATUS_CODES,
    Decision,
    Horizon,
    PlanColumns,
    VehicleState,
)
from colibri.autopilot.estimation.health import estimator_state
from colibri.autopilot.estimation.state_source import StateSource
from colibri.autopilot.ground.forecast import Forecaster
from colibri.autopilot.guidance.guidance import Guidance
from colibri.autopilot.guidance.reference import ALL_BOUND
from colibri.autopilot.guidance.tasks.guided import GuidedTask
from colibri.autopilot.guidance.tasks.task import PositionMotion
from colibri.common.compiled_rotations import quaternion_from_euler
from colibri.common.types import Array, PerRotor, Vector
from colibri.mavlink.setpoints.setpoints import PositionSetpoint
from colibri.mavlink.telemetry.snapshot import (
    NO_SETPOINT,
    NOT_SOLVED,
    NOWHERE,
    BatteryState,
    HomePosition,
    Setpoint,
    SolverState,
    TelemetrySnapshot,
)
from colibri.mavlink.wire.dialect import mav
from colibri.plant.vehicle.description import Vehicle

FORECAST_EVERY_US = 200_000
_NEAR_GROUND_M = 1.0
_SINKING_M_S = -0.1


class SnapshotBuilder:
    def __init__(self, vehicle: Vehicle, interval_s: float, columns: PlanColumns | None) -> None:
        self._interval_s = interval_s
        self._columns = columns
        self.adopt(vehicle)

    def adopt(self, vehicle: Vehicle) -> None:
        self._max_speed_rad_s = vehicle.rotors.max_speed * vehicle.rad_s_per_speed_unit
        self._levers = levers_of(vehicle)
        self._forecaster = Forecaster(vehicle, self._interval_s, self._columns)
        self._velocity: Vector | None = None
        self._solver = NOT_SOLVED

    def take(
        self,
        now_us: int,
        state: VehicleState,
        pilot: Pilot,
        guidance: Guidance,
        decision: Decision | None,
        duration_s: float,
        controls: PerRotor,
        battery: BatteryState | None,
        fence: Fence,
        state_source: StateSource,
        modes: ModeSelection,
        *,
        breached: bool,
    ) -> TelemetrySnapshot:
        sticks, times, home = pilot.sensed.steered.sticks, pilot.ground.times, pilot.home
        armed = pilot.state.armed
        modes.update()
        vx, vy, vz = velocity = state.velocity_enu_m_s
        (ux, uy, uz), self._velocity, dt = self._velocity or velocity, velocity, self._interval_s
        speed = self._max_speed_rad_s
        return TelemetrySnapshot(
            time_us=now_us,
            armed=armed,
            base_mode=modes.base_modes[sticks is not None],
            custom_mode=modes.shown.number,
            intended_custom_mode=modes.shown.number,
            standard_mode=modes.shown.standard,
            px4_mode=custom_mode(pilot.state.mode),
            landed_state=landed_state(pilot, state),
            failsafe=pilot.saving is not Action.NONE,
            emergency=pilot.saving >= Action.LAND,
            terminated=pilot.terminated,
            armable=pilot.readiness.may_arm,
            position_enu_m=state.position_enu_m,
            velocity_enu_m_s=velocity,
            acceleration_enu_m_s2=((vx - ux) / dt, (vy - uy) / dt, (vz - uz) / dt),
            attitude=state.attitude,
            rate_flu_rad_s=state.rate_flu_rad_s,
            origin=home.origin,
            gps_ok=state_source.has_gps(now_us),
            fence_enabled=fence.exists,
            fence_breached=breached,
            fence_breaches=fence.breaches,
            fence_breach_type=fence.breach_type,
            fence_breached_us=fence.breached_us,
            home=HomePosition(home.position_enu_m, home.yaw_rad),
            rotor_speeds_rad_s=tuple([control * speed for control in controls]),
            controls=controls,
            levers=self._levers,
            battery=battery,
            setpoint=setpoint(guidance, decision, controls),
            solver=self._solver_state(now_us, state, guidance.horizon, decision, duration_s),
            delay_us=pilot.sensed.delay_us,
            sticks=None if sticks is None else (sticks.pitch, sticks.roll, sticks.thrust, sticks.yaw),
            channels=pilot.sensed.steered.channels,
            target_enu_m=destination(pilot) if modes.book.destination else NOWHERE,
            requested=requested(pilot.task.setpoint) if isinstance(pilot.task, GuidedTask) else None,
            flight_started_us=times.armed_us,
            takeoff_us=times.takeoff_us,
            landing_us=times.landing_us,
            flights=times.flights,
            ground_m=home.position_enu_m[2],
            load=min(duration_s / dt, 1.0),
            sensed=state_source.sensed,
            fix=state_source.fix,
            latest=dict(state_source.latest) if state_source.latest else {},
            estimator=None if state_source.estimate is None else estimator_state(state_source.estimate),
        )

    def _solver_state(
        self, now_us: int, state: VehicleState, horizon: Horizon | None, decision: Decision | None, duration_s: float
    ) -> SolverState:
        if decision is None:
            return NOT_SOLVED
        how = decision.diagnostics
        forecast = self._solver.horizon
        squared = self._solver.planned_squared
        if now_us % FORECAST_EVERY_US == 0:
            forecast = self._forecaster.forecast(state, horizon, how)
            squared = () if how.planned_squared is None else tuple(map(tuple, how.planned_squared.tolist()))
        self._solver = SolverState(
            STATUS_CODES[how.qp_status],
            FALLBACK_CODES[how.fallback],
            -1 if isnan(how.qp_iterations) else int(how.qp_iterations),
            *(how.solve_time_s, duration_s, how.cost, how.slack, how.active),
            *(squared, forecast, how.mass_kg, how.path_lag_s),
        )
        return self._solver


def destination(pilot: Pilot) -> Vector:
    """Return the place that is flown to; nan without one."""
    wanted = pilot.wanted if pilot.state.armed else None
    if not isinstance(wanted, PositionMotion) or wanted.target.kinds != ALL_BOUND:
        return NOWHERE
    x, y, z = wanted.target.motion[-1, 0].tolist()
    return (x, y, z)


def requested(setpoint: PositionSetpoint | None) -> Setpoint | None:
    if setpoint is None:
        return None
    moves = (setpoint.velocity_m_s, setpoint.acceleration_m_s2)
    return Setpoint(setpoint.position_enu_m, *moves, setpoint.yaw_rad, setpoint.yaw_rate_rad_s)


def landed_state(pilot: Pilot, state: VehicleState) -> int:
    if pilot.ground.standing:
        return int(mav.MAV_LANDED_STATE_ON_GROUND)
    mode = pilot.state.mode
    if mode is Mode.TAKEOFF:
        return int(mav.MAV_LANDED_STATE_TAKEOFF)
    if mode is Mode.LAND or (mode is Mode.RETURN and _comes_down(pilot, state)):
        return int(mav.MAV_LANDED_STATE_LANDING)
    return int(mav.MAV_LANDED_STATE_IN_AIR)


def _comes_down(pilot: Pilot, state: VehicleState) -> bool:
    reference, height_m = pilot.generator.reference, state.position_enu_m[2] - pilot.home.position_enu_m[2]
    return height_m < _NEAR_GROUND_M and reference is not None and float(reference.motion[1, 2]) < _SINKING_M_S


def levers_of(vehicle: Vehicle) -> tuple[PerRotor, PerRotor, PerRotor]:
    """Return how roll, pitch and yaw, FRD, follow from rotor controls, -1 to 1."""
    x, y, _ = vehicle.arms_m().T
    rows = ((y, 1.0), (x, 1.0), (vehicle.rotors.spin(), 2.0))
    roll, pitch, yaw = (tuple((most * row / max(float(np.abs(row).sum()), 1e-9)).tolist()) for row, most in rows)
    return roll, pitch, yaw


def setpoint(guidance: Guidance, decision: Decision | None, controls: PerRotor) -> Setpoint:
    if decision is None:
        return NO_SETPOINT
    thrust = sum([control * control for control in controls]) / len(controls)
    attitude = quaternion_from_euler(*decision.attitude_reference)
    if guidance.horizon is None:
        # for small tilt the rates of the angles are those of the body
        rates = NOWHERE if guidance.attitude is None else first(guidance.attitude.angle_rates_rad_s)
        return Setpoint(attitude=attitude, rate_flu_rad_s=rates, thrust=thrust)
    h = guidance.horizon
    return Setpoint(
        position_enu_m=first(h.position_enu_m),
        velocity_enu_m_s=first(h.velocity_enu_m_s),
        acceleration_enu_m_s2=first(h.acceleration_enu_m_s2),
        yaw_rad=h.yaw_rad.item(0),
        yaw_rate_rad_s=h.yaw_rate_rad_s.item(0),
        attitude=attitude,
        rate_flu_rad_s=NOWHERE,
        thrust=thrust,
    )


def first(column: Array) -> Vector:
    return (column.item(0), column.item(1), column.item(2))
