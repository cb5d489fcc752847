"""A control loop over the plant, with restarts and attitude demands in flight."""

from math import acos, degrees
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from colibri.autopilot.control.interface import AttitudeDemand, VehicleState
from colibri.autopilot.control.loop import ControlLoop
from colibri.autopilot.guidance.trajectories.planner import Planner
from colibri.common.rotations import rotation_matrix
from colibri.common.types import Array
from colibri.conformance.subject import Subject
from colibri.flights.plan import FlightPlan
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.plant.physics.world import Physics, World, starting_world, state_frame


class LoopFlight:
    def __init__(self, subject: Subject, plan: FlightPlan) -> None:
        self._subject, self._plan = subject, plan
        self._physics = Physics(plan.plant_vehicle, "rk4")
        self.world: World = starting_world(plan.start, plan.plant_vehicle)
        self.loop = self.new_loop()
        self._planner = Planner(plan.track, plan.profile.references, self.loop.preview)
        self.loop.begin(self._subject.vehicle.hover_speed, plan.start_yaw_rad)

    def new_loop(self) -> ControlLoop:
        return ControlLoop(self._subject.profile, self._subject.vehicle, perf_counter, self._subject.law)

    def fly(self, seconds: float) -> Array:
        """Follow the track; return the distance to the reference at each control sample, m."""
        off_m = []
        for _ in range(self._samples(seconds)):
            state = self.loop.observe(state_frame(self.world))
            references = self._planner.horizon_at(self.world.time_us, self.loop.control_interval_us)
            off_m.append(np.linalg.norm(references.position_enu_m[0] - state.position_enu_m))
            self.loop.decide(self.world.time_us, state, references)
            self._go_on()
        return np.array(off_m)

    def hold(self, angles: tuple[float, float, float], thrust_n: float) -> VehicleState:
        n = self.loop.preview.samples
        demand = AttitudeDemand(np.tile(angles, (n, 1)), np.zeros((n, 3)), np.full(n, thrust_n))
        for _ in range(self._samples(HELD_S)):
            state = self.loop.observe(state_frame(self.world))
            self.loop.decide_attitude(self.world.time_us, state, demand)
            self._go_on()
        return self.loop.observe(state_frame(self.world))

    @property
    def tilt_deg(self) -> float:
        return degrees(acos(min(max(rotation_matrix(state_frame(self.world).attitude)[2][2], -1.0), 1.0)))

    def _samples(self, seconds: float) -> int:
        return round(seconds * 1e6) // self.loop.control_interval_us

    def _go_on(self) -> None:
        command = ActuatorCommand(self.world.time_us, self.loop.controls, armed=True)
        self.world = self._physics.step(self.world, command, self.loop.control_interval_us)


class Restarted(NamedTuple):
    """A flight with a restart in its middle.

    Attributes:
        unbroken_m, off_m: Distance to the reference afterwards, m, (n,), without and with it.
        same: Both flights are identical, bit for bit.
        is_plain: The law's memory was kept.
    """

    unbroken_m: Array
    off_m: Array
    tilt_deg: float
    same: bool
    is_plain: bool


_BEFORE_S, _AFTER_S, HELD_S = 1.0, 3.0, 1.5
"""Durations before and after a restart, and of a held attitude."""
HOW = ("seamless", "anew", "blind")


def restarted(
    track: str,
    *,
    how: str,
    controller: Any,
    profile: Any = None,
    vehicle: Any = None,
    seed: int = 0,
    **options: Any,
) -> Restarted:
    """Fly, replace the control loop in flight, and fly on.

    `how` is `seamless`: from a recent checkpoint; `anew`: from an old one, with only charge and mass; or `blind`:
    without.
    """
    subject = Subject.of(controller, profile, vehicle, seed)
    return restart(subject, how, subject.plan(track, **options))


def restart(subject: Subject, how: str, plan: FlightPlan) -> Restarted:
    flight = LoopFlight(subject, plan)
    flight.fly(_BEFORE_S)
    kept, yaw_rad, world = flight.loop.record(), flight.loop.observe(state_frame(flight.world)).euler[2], flight.world
    unbroken_m, unbroken = flight.fly(_AFTER_S), flight.world
    flight.loop, flight.world = flight.new_loop(), world
    if how == "blind":
        flight.loop.begin_in_flight(yaw_rad)
    else:
        flight.loop.resume(kept, seamless=how == "seamless")
    off_m = flight.fly(_AFTER_S)
    return Restarted(unbroken_m, off_m, flight.tilt_deg, flight.world.state == unbroken.state, bool(kept.memory))


def held(
    phi: float,
    theta: float,
    *,
    thrust_n: float,
    controller: Any,
    profile: Any = None,
    vehicle: Any = None,
) -> VehicleState:
    """Have a law hold roll and pitch, rad, and a thrust, N, for 1.5 s from hover; return the final state."""
    return hold(Subject.of(controller, profile, vehicle, 0), phi, theta, thrust_n)


def hold(subject: Subject, phi: float, theta: float, thrust_n: float) -> VehicleState:
    flight = LoopFlight(subject, subject.plan("hover:height=60", start=subject.start(z=60.0)))
    yaw_rad = flight.loop.observe(state_frame(flight.world)).euler[2]
    return flight.hold((phi, theta, yaw_rad), thrust_n)
