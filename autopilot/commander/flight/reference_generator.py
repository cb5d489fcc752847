"""Moves the reference to a task's target, and previews it."""

import numpy as np

from colibri.autopilot.control.interface import Horizon, Pace, VehicleState
from colibri.autopilot.guidance.guidance import Instants
from colibri.autopilot.guidance.integrator_chain import Limits
from colibri.autopilot.guidance.reference import (
    Reference,
    Target,
    at_rest,
    lead,
    lead_along,
    moving_with,
    slowed,
    stays,
    still_target,
)
from colibri.autopilot.guidance.tasks.task import PlannedMotion, PositionMotion, TaskContext
from colibri.autopilot.guidance.trajectories.planner import carried
from colibri.common.records import Record


class Led(Record, frozen=True):
    """The last movement to a target, reused while the reference rests (`stays`)."""

    target: Target
    limits: Limits
    horizon: Horizon
    for_law: Horizon
    reference: Reference
    stays: bool

    def is_again(self, reference: Reference, target: Target, limits: Limits) -> bool:
        return self.stays and reference is self.reference and target is self.target and limits == self.limits


class ReferenceGenerator:
    """Reference of one vehicle, with `samples` planned instants."""

    def __init__(self, instants: Instants, limits: Limits) -> None:
        self._instants = instants
        self.interval_s = instants.preview.interval_us * 1e-6
        self.samples = instants.preview.samples
        self.reference: Reference | None = None
        self._ahead: Horizon | None = None
        self._led: Led | None = None
        self._waited = False
        self._path_speed = 1.0
        motionless = Reference(np.zeros((4, 3)), np.zeros(2))
        lead(motionless, still_target((1.0, 0.0, 0.0), 0.0, self.samples), limits, self.interval_s)

    def set(self, reference: Reference) -> None:
        self.reference, self._ahead = reference, None

    def follow(self, vehicle: VehicleState) -> None:
        self.set(moving_with(vehicle))

    def drift(self, vehicle: VehicleState) -> None:
        """Follow the horizontal motion and yaw; the height goes on."""
        before, after = self.reference, moving_with(vehicle)
        if before is not None:
            after.motion[:, 2] = before.motion[:, 2]
        self.set(after)

    def rest(self, vehicle: VehicleState) -> None:
        self.set(at_rest(vehicle))

    def wait(self, waited_s: float, path_speed: float) -> None:
        """Move the reference back by the path time lost in the last sample."""
        self._path_speed = path_speed
        if waited_s != 0.0 and self._ahead is not None:
            following = Horizon(*(column[1:2] for column in self._ahead))
            p, v, a, j, _, yaw, yaw_rate, _ = carried(following, -waited_s)
            self.reference = Reference(np.concatenate((p, v, a, j)), np.concatenate((yaw, yaw_rate)))
            self._waited = True

    def lead(self, context: TaskContext, wanted: PositionMotion | PlannedMotion) -> Horizon:
        reference, waited = context.reference, self._waited
        if wanted.pace is Pace.CLOCK and self._path_speed != 1.0:
            reference = slowed(reference, self._path_speed)
        if isinstance(wanted, PositionMotion):
            self._led = led = self._lead_to(reference, wanted, waited=waited)
            self._ahead, self._waited, self.reference = led.horizon, False, led.reference
            return led.for_law
        horizon, self.reference = lead_along(reference, wanted.horizon, wanted.limits, self.interval_s, waited=waited)
        self._ahead, self._waited = horizon, False
        if wanted.for_law is not None and horizon.position_enu_m is wanted.horizon.position_enu_m:
            turned = horizon.yaw_rad[0] - wanted.horizon.yaw_rad[0]
            return wanted.for_law._replace(yaw_rad=wanted.for_law.yaw_rad + turned)
        return self._instants.for_law(horizon)

    def _lead_to(self, reference: Reference, wanted: PositionMotion, *, waited: bool) -> Led:
        before, target, limits = self._led, wanted.target, wanted.limits
        if before is not None and not waited and before.is_again(reference, target, limits):
            return before
        horizon, after = lead(reference, target, limits, self.interval_s, waited=waited)
        stayed = not waited and stays(reference, after)
        return Led(target, limits, horizon, self._instants.for_law(horizon), after, stayed)
