"""The flight task that follows the target of FOLLOW_TARGET."""

from math import hypot, pi, radians

import numpy as np

from colibri.autopilot.guidance.reference import still_target
from colibri.autopilot.guidance.tasks.offboard import allowed_velocity
from colibri.autopilot.guidance.tasks.position import HoldTask
from colibri.autopilot.guidance.tasks.task import EndlessTask, PositionMotion, TaskContext
from colibri.common.kernels import atan2, cos, sin

_STANDS_M_S = 0.3
MIN_HEIGHT_M = 1.0  # above home: PX4's MINIMUM_SAFETY_ALTITUDE
ABOVE_TARGET = 2  # of `Behaviour.follow_altitude_mode`; the others refer to flat ground


class FollowTargetTask(EndlessTask):
    def __init__(self) -> None:
        self._stop = HoldTask()
        self._ahead_rad: float | None = None

    def update(self, context: TaskContext) -> PositionMotion:
        followed = context.steered.followed
        if followed is None:
            return self._stop.update(context)
        self._stop = HoldTask()
        vx, vy, vz = allowed_velocity(followed.velocity_enu_m_s, context)
        x, y, z = followed.position_enu_m
        if hypot(vx, vy) > _STANDS_M_S:
            self._ahead_rad = atan2(vy, vx)
        elif self._ahead_rad is None:
            self._ahead_rad = atan2(y - context.place[1], x - context.place[0])
        behaviour = context.behaviour
        side = self._ahead_rad - radians(behaviour.follow_angle_deg)
        x, y = x + behaviour.follow_distance_m * cos(side), y + behaviour.follow_distance_m * sin(side)
        if behaviour.follow_altitude_mode != ABOVE_TARGET:
            z, vz = context.home_enu_m[2], 0.0
        height_m, min_height_m = z + behaviour.follow_height_m, context.home_enu_m[2] + MIN_HEIGHT_M
        if height_m < min_height_m:
            height_m, vz = min_height_m, max(vz, 0.0)
        target = still_target((x, y, height_m), side + pi, context.samples)
        target.motion[:, 1] = vx, vy, vz
        target.motion[:, 0] += np.outer(context.interval_s * np.arange(context.samples), (vx, vy, vz))
        return PositionMotion(target, behaviour.limits)
