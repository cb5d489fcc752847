"""The thesis's second strategy: position by feedback linearisation, attitude by LPV-MPC, one after the other."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from autopilot.attitude import AttitudeMpc
from autopilot.lpv import Array
from autopilot.mixer import Mixer
from autopilot.planner import Horizon
from autopilot.position import AttitudeAndThrust, PositionController
from autopilot.profile import Profile
from autopilot.qp import QpSolver, QpStatus
from mavlink.frames import Vector
from plant.vehicle import Vehicle


class VehicleState(NamedTuple):
    """What a control law knows of the vehicle.

    Attributes:
        position_enu_m: Position, m, ENU.
        velocity_enu_m_s: Velocity, m/s, ENU.
        euler: phi, theta, psi in rad, psi unwrapped.
        rate_flu_rad_s: Body rates p, q, r, rad/s, FLU.
    """

    position_enu_m: Vector
    velocity_enu_m_s: Vector
    euler: Vector
    rate_flu_rad_s: Vector


class Memory(NamedTuple):
    """What the cascade carries from one control sample to the next.

    Attributes:
        rotor_speeds: The last ones commanded, in the vehicle's unit, (4,).
        demand: What the outer loop asked for, held along the outer sample; None before its first.
    """

    rotor_speeds: Array
    demand: AttitudeAndThrust | None


class Decision(NamedTuple):
    """What a control law decided, and how.

    Attributes:
        rotor_speeds: In the vehicle's unit, within its limits, (4,).
        reference: phi, theta, psi that the attitude was steered to, rad.
        qp_status: How the QP ended.
        solve_time_s: Time that the QP took.
    """

    rotor_speeds: Array
    reference: Vector
    qp_status: QpStatus
    solve_time_s: float


class Cascade:
    """The control law: one call a control sample.

    Attributes:
        preview: How many references it needs, from the present outer sample on.
    """

    preview = 2

    def __init__(self, profile: Profile, vehicle: Vehicle, clock: Callable[[], float]) -> None:
        """Control `vehicle` as `profile` says; `clock` only measures, it decides nothing."""
        self._samples = profile.position.samples
        self._interval_us = profile.control_interval_us
        self._horizon = profile.attitude.horizon
        self._shrinking = profile.attitude.shrinking_horizon
        self._position = PositionController(profile.position, vehicle)
        solver = QpSolver(profile.qp.solver, profile.qp.tolerance)
        self._attitude = AttitudeMpc(profile.attitude, vehicle, solver, profile.control_interval_s, clock)
        self._mixer = Mixer(vehicle)

    def initial(self, rotor_speed: float) -> Memory:
        """Return the memory of a controller whose rotors all turn at `rotor_speed` (the vehicle's unit)."""
        return Memory(np.full(4, rotor_speed), None)

    def step(self, memory: Memory, time_us: int, state: VehicleState, references: Horizon) -> tuple[Memory, Decision]:
        """Decide the rotor speeds to hold until the next control sample."""
        sample = (time_us // self._interval_us) % self._samples
        demand = memory.demand
        if demand is None or sample == 0:
            demand = self._demand(state, references)
        reference = (demand.phi, demand.theta, float(references.yaw_rad[1]))
        attitude = self._attitude.step(
            state.euler,
            state.rate_flu_rad_s,
            self._mixer.wrench(memory.rotor_speeds)[1:],
            self._mixer.momentum(memory.rotor_speeds),
            reference,
            self._horizon - sample if self._shrinking else self._horizon,
        )
        speeds = self._mixer.rotor_speeds(np.array([demand.thrust_n, *attitude.moment_n_m]))
        return Memory(speeds, demand), Decision(speeds, reference, attitude.status, attitude.solve_time_s)

    def _demand(self, state: VehicleState, references: Horizon) -> AttitudeAndThrust:
        """Steer to the reference of the next outer sample."""
        x, y, z = references.position_enu_m[1].tolist()
        vx, vy, vz = references.velocity_enu_m_s[1].tolist()
        return self._position.step(
            state.position_enu_m, state.velocity_enu_m_s, (x, y, z), (vx, vy, vz), float(references.yaw_rad[1])
        )
