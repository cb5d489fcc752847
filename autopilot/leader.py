"""The course behind a leader: where FOLLOW_TARGET says that it is, at a distance, seen from a chosen side."""

from math import atan2, cos, hypot, radians, sin

import numpy as np

from autopilot.courses import Motion, Scene, Stop
from autopilot.reference import ALL_BOUND, Target, still_target

_GOES_ON_US = 3_000_000
"""A leader that falls silent is thought to go on for so long."""
_STANDS_M_S = 0.3


class Following:
    """A place relative to the leader; without a leader, stop."""

    def __init__(self) -> None:
        """Follow nobody yet."""
        self._stop = Stop()
        self._ahead_rad: float | None = None

    def ask(self, scene: Scene) -> Motion:
        """Return the place that moves with the leader, looking at it."""
        leader = scene.steered.leader
        if leader is None:
            return self._stop.ask(scene)
        self._stop = Stop()
        now = leader.at(scene.now_us, _GOES_ON_US)
        vx, vy, vz = now.velocity_enu_m_s
        x, y, z = now.position_enu_m
        if hypot(vx, vy) > _STANDS_M_S:
            self._ahead_rad = atan2(vy, vx)
        elif self._ahead_rad is None:
            self._ahead_rad = atan2(y - scene.place[1], x - scene.place[0])
        behaviour = scene.behaviour
        side = self._ahead_rad - radians(behaviour.follow_angle_deg)
        place = (x + behaviour.follow_distance_m * cos(side), y + behaviour.follow_distance_m * sin(side))
        height_m = behaviour.follow_height_m + (z if behaviour.follow_altitude_mode else scene.home_enu_m[2])
        ahead_s = scene.interval_s * np.arange(scene.samples)
        target = still_target((*place, height_m), side + np.pi, scene.samples)
        for axis, speed in enumerate((vx, vy, vz if behaviour.follow_altitude_mode else 0.0)):
            target.motion[:, 0, axis] += speed * ahead_s
            target.motion[:, 1, axis] = speed
        return Motion(Target(target.motion, ALL_BOUND, target.heading), scene.behaviour.limits)

    def arrived(self, scene: Scene) -> bool:
        """Never by itself."""
        del scene
        return False
