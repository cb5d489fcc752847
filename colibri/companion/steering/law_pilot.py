"""Fly a control law on a vehicle whose rotors it cannot command (docs/companion.md).

The vehicle file's rotors follow the law's speeds and turn the modelled vehicle for one interval; the inverse of the
stack's response gives the roll and pitch rates. Stacks differ too much in yaw: the law's references turn with the
vehicle, and a separate loop commands the yaw rate.
"""

from math import cos, dist, hypot, sin
from typing import NamedTuple

import numpy as np

from colibri.autopilot.commander.flight.reference_generator import ReferenceGenerator
from colibri.autopilot.control.interface import Clock, Decision, Horizon, VehicleState
from colibri.autopilot.control.loop import ControlLoop
from colibri.autopilot.control.profile import Profile
from colibri.autopilot.control.registry import Factory
from colibri.autopilot.control.vehicle_model import motion
from colibri.autopilot.control.vehicle_model.battery import open_voltage_v
from colibri.autopilot.ground.snapshots import first
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.guidance.guidance import instants
from colibri.autopilot.guidance.integrator_chain import Limits
from colibri.autopilot.guidance.tasks.orders import GoTo
from colibri.autopilot.guidance.tasks.position import GoToTask, HoldTask, TakeoffTask, TaskSequence, TrackTask
from colibri.autopilot.guidance.tasks.task import FlightTask, PlannedMotion, PositionMotion, TaskContext
from colibri.autopilot.guidance.trajectories.planner import Planner
from colibri.autopilot.guidance.trajectories.tracks import Track
from colibri.common.jit import packed
from colibri.common.rotations import euler_from_quaternion, nearest_turn
from colibri.common.types import Array, Vector
from colibri.companion.stack import Response
from colibri.companion.steering import predictor as model
from colibri.companion.steering.predictor import slowed
from colibri.companion.steering.references import Stay
from colibri.mavlink.hil.state import StateFrame
from colibri.plant.vehicle.description import Vehicle

APPROACH = Limits(
    speed_m_s=2.0, climb_m_s=1.0, sink_m_s=1.0, acceleration_m_s2=2.0, lift_m_s2=2.0, jerk_m_s3=8.0, yaw_rate_rad_s=0.8
)
"""Limits on the way to the track."""
_MAX_INTERVAL_US = 10_000  # setpoints are sent at 100 Hz or more
_THERE_M, _THERE_M_S = 0.002, 0.005
_YAW_1_S = 2.0  # gain of the heading error
_MIN_UPRIGHT = 0.2
_NO_DISTURBANCE = np.zeros(6)


class ApproachTask(GoToTask):
    """To the first point of the track, until the reference stands there."""

    def arrived(self, context: TaskContext) -> bool:
        there = dist(context.place, self._place) < _THERE_M and hypot(*context.velocity) < _THERE_M_S
        return there and super().arrived(context)


class LawDemand(NamedTuple):
    """Demand of a law; decisions are `None` between two of them, `track_s` is negative before the track."""

    rate_flu_rad_s: Vector
    thrust_n: float
    reference: Horizon | None
    decision: Decision | None
    track_enu_m: Vector | None
    track_s: float


class LawPilot:
    def __init__(
        self,
        profile: Profile,
        vehicle: Vehicle,
        track: Track,
        response: Response,
        clock: Clock,
        law: Factory | None = None,
    ) -> None:
        self._profile, self._clock, self._law = profile, clock, law
        self._airframe, self._track = vehicle, track
        self.adopt(response)
        self._instants = instants(self._loop.preview, self._loop.control_interval_us)
        self._planner = Planner(track, profile.references, self._instants.preview)
        self._behaviour = Behaviour(limits=APPROACH)
        self._generator = ReferenceGenerator(self._instants, APPROACH)
        parts = -(-self._loop.control_interval_us // _MAX_INTERVAL_US)
        self.interval_us = self._loop.control_interval_us // parts
        self._parts, self._tick = parts, 0
        self._heading = (0.0, 0.0, 0.0)
        self._ahead_s = 1e-6 * self._loop.preview.interval_us * np.arange(self._loop.preview.samples)
        self._rotors = np.full(vehicle.rotors.count, vehicle.hover_speed)
        self._task: FlightTask = HoldTask()
        carried = np.zeros(motion.RIGID + vehicle.rotors.count)
        carried[6] = 1.0
        motion.carry(carried, np.ones(1), np.zeros((1, vehicle.rotors.count)), _NO_DISTURBANCE, 1.0, self._motion)

    @property
    def start_enu_m(self) -> Vector:
        return first(self._planner.horizon(0).position_enu_m)

    def adopt(self, response: Response) -> None:
        self._response = response
        self._vehicle = turning_no_faster(self._airframe, response)
        self._loop = ControlLoop(
            slowed(self._profile.of(self._vehicle), response), self._vehicle, self._clock, self._law
        )
        self._motion = packed(motion.motion_model(self._vehicle))
        self._lags = max(response.acceleration_lag_s[:2]) > 0.0

    def begin(self, y: Array) -> None:
        """Brake from state `y`, (17,), and stay."""
        frame = _frame(0, y)
        self._tick = 0
        self._loop.begin(self._vehicle.hover_speed, self._loop.observe(frame).euler[2])
        self._rotors = np.full(self._vehicle.rotors.count, self._vehicle.hover_speed)
        self._generator.follow(self._loop.observe(frame))
        self._task = HoldTask()

    def fly_track(self, stay: Stay | None = None) -> None:
        """Go to the track and along it, or stay."""
        reference = self._generator.reference
        if stay is not None and reference is not None:
            self._track = stay.track(first(reference.motion), float(reference.heading[0]))
            self._planner = Planner(self._track, self._profile.references, self._instants.preview)
        start, yaw_rad = self.start_enu_m, float(self._planner.horizon(0).yaw_rad[0])
        self._task = TaskSequence(
            lambda context: TakeoffTask(start[2], None, context),
            lambda context: ApproachTask(GoTo(start, yaw_rad), context),
            lambda context: TrackTask(self._planner, self._track.duration_s, context.now_us),
        )

    def hold(self) -> None:
        self._task = HoldTask()

    @property
    def finished(self) -> bool:
        task = self._flown
        return isinstance(task, TrackTask) and self._time_us - task.began_us > self._track.duration_s * 1e6

    @property
    def _flown(self) -> FlightTask | None:
        return self._task.task if isinstance(self._task, TaskSequence) else self._task

    @property
    def _time_us(self) -> int:
        return self._tick * self.interval_us

    def step(self, y: Array) -> LawDemand:
        """Return the demand for state `y` at the time of effect, once an interval."""
        decision, horizon, place = None, None, None
        time_us = self._time_us
        if self._tick % self._parts == 0:
            state = self._loop.observe(_frame(time_us, y))
            horizon, place = self._references(time_us, state)
            yaw, yaw_rate, yaw_acceleration = (float(of[0]) for of in horizon[5:])
            self._heading = (yaw, yaw_rate, yaw_acceleration)
            decision = self._loop.decide(time_us, state, self._turning_as_it_does(horizon, state))
        speeds = np.array(self._loop.controls) * self._vehicle.rotors.max_speed
        x = np.concatenate((y[: model.LIFT], self._rotors))
        interval_s = self.interval_us * 1e-6
        after = self._carried(x, speeds)
        before_n = motion.thrust_n(self._rotors, self._motion)
        self._rotors = after[motion.ROTORS]
        thrust = 0.5 * (before_n + motion.thrust_n(self._rotors, self._motion))
        reached = after
        if self._lags:
            at_speed = np.concatenate((x[: motion.ROTORS.start], speeds))
            reached, thrust = self._carried(at_speed, speeds), motion.thrust_n(speeds, self._motion)
        now, then = y[model.RATE].tolist(), reached[motion.RATE].tolist()
        p, q, _ = model.rate_command(tuple(now), tuple(then), interval_s, self._response)
        self._tick += 1
        track_s = (time_us - self._flown.began_us) * 1e-6 if isinstance(self._flown, TrackTask) else -1.0
        return LawDemand((p, q, self._yaw_rate(y, q)), thrust, horizon, decision, place, track_s)

    def _carried(self, x: Array, speeds: Array) -> Array:
        interval_s, battery = np.array([self.interval_us * 1e-6]), self._vehicle.battery
        voltage_v = 1.0 if battery is None else open_voltage_v(battery, self._loop.charge_ah)
        return motion.carry(x, interval_s, speeds[None], _NO_DISTURBANCE, voltage_v, self._motion)

    def _turning_as_it_does(self, horizon: Horizon, state: VehicleState) -> Horizon:
        (phi, theta, psi), (_, q, r) = state.euler, state.rate_flu_rad_s
        turns = (sin(phi) * q + cos(phi) * r) / max(cos(theta), _MIN_UPRIGHT)  # THESIS [2.7]
        yaw = np.asarray(psi + turns * self._ahead_s, dtype=np.float64)
        return horizon._replace(
            yaw_rad=yaw, yaw_rate_rad_s=np.full_like(yaw, turns), yaw_acceleration_rad_s2=np.zeros_like(yaw)
        )

    def _yaw_rate(self, y: Array, q: float) -> float:
        """Return the body rate r for the heading reference, rad/s."""
        phi, theta, psi = euler_from_quaternion(tuple(y[model.ATTITUDE].tolist()))
        wanted, rate, acceleration = self._heading
        off = nearest_turn(wanted, psi) - psi
        turns = rate + self._response.time_constant_s[2] * acceleration + _YAW_1_S * off
        r = (turns * cos(theta) - sin(phi) * q) / max(cos(phi), _MIN_UPRIGHT)
        maximum = self._response.max_rate_rad_s[2]
        return min(max(r, -maximum), maximum)

    def _references(self, time_us: int, state: VehicleState) -> tuple[Horizon, Vector | None]:
        generator = self._generator
        assert generator.reference is not None, "it was begun"
        place, grid = state.position_enu_m, (generator.interval_s, generator.samples)
        context = TaskContext(time_us, state, generator.reference, place, self._behaviour, *grid)
        wanted = self._task.update(context)
        assert isinstance(wanted, PositionMotion | PlannedMotion), "no task of these asks for attitudes"
        horizon = generator.lead(context, wanted)
        return horizon, first(wanted.horizon.position_enu_m) if isinstance(wanted, PlannedMotion) else None


def turning_no_faster(vehicle: Vehicle, response: Response) -> Vehicle:
    """Limit the acceleration to that of the stack by larger moments of inertia, else a law would overshoot."""
    _, *moments_n_m = vehicle.max_wrench().tolist()
    most = response.max_acceleration_rad_s2
    ix, iy = (
        max(inertia, moment / limit)
        for inertia, moment, limit in zip(vehicle.body.inertia_kg_m2[:2], moments_n_m[:2], most[:2], strict=True)
    )
    iz = max(vehicle.body.inertia_kg_m2[2], abs(ix - iy))
    turned = vehicle.replace("body.inertia_kg_m2", (ix, iy, iz))
    behind_s = max(response.acceleration_lag_s[:2])
    if behind_s == 0.0:
        return turned
    return turned.replace("rotors.lag", {"time_constant_up_s": behind_s, "time_constant_down_s": behind_s})


def _frame(time_us: int, y: Array) -> StateFrame:
    px, py, pz, vx, vy, vz, qw, qx, qy, qz, p, q, r = y[: model.LIFT].tolist()
    return StateFrame(time_us, (px, py, pz), (vx, vy, vz), (qw, qx, qy, qz), (p, q, r))
