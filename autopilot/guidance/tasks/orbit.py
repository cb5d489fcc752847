"""The flight task of a circle."""

from math import copysign, hypot, pi, sqrt

import numpy as np

from colibri.autopilot.control.interface import Pace
from colibri.autopilot.guidance.reference import ALL_BOUND, Target
from colibri.autopilot.guidance.tasks.orders import GoTo, Orbit
from colibri.autopilot.guidance.tasks.position import GoToTask
from colibri.autopilot.guidance.tasks.task import EndlessTask, PositionMotion, TaskContext
from colibri.common import elementwise
from colibri.common.kernels import atan2, cos, sin
from colibri.common.types import Array, Vector
from colibri.mavlink.wire.dialect import mav

_SHARE = 0.8  # part of the horizontal acceleration allowed for the circle
_ON_IT_M, _ON_IT_M_S = 0.3, 0.5  # distance and radial speed at which the circle is joined


class OrbitTask(EndlessTask):
    """Fly to the nearest point of the circle, then along it."""

    def __init__(self, order: Orbit, context: TaskContext) -> None:
        self.order = order
        self._radius_m = abs(order.radius_m)
        self._turn = -copysign(1.0, order.radius_m)
        self._first_yaw_rad = context.yaw_rad
        self._angle = self._angle_of(context.place)
        x, y, z = order.center_enu_m
        entry = (x + self._radius_m * cos(self._angle), y + self._radius_m * sin(self._angle), z)
        yaw_rad = float(self._heading(np.array([self._angle]), 0.0)[0, 0])
        self._way = GoToTask(GoTo(entry, yaw_rad, order.speed_m_s), context)
        self._circles, self._rate = False, 0.0
        self.turns = 0.0

    def update(self, context: TaskContext) -> PositionMotion:
        if not self._circles:
            if not self._joins(context):
                return self._way.update(context)
            self._circles, angle, (vx, vy, _) = True, self._angle_of(context.place), context.velocity
            self._angle, self._rate = angle, (vy * cos(angle) - vx * sin(angle)) / self._radius_m
        rate = self._rate = self._towards(self._turn * self._speed_m_s(context) / self._radius_m, context)
        angles: Array = self._angle + rate * context.interval_s * np.arange(context.samples, dtype=np.float64)
        self._angle = float(angles[1])
        self.turns += abs(rate) * context.interval_s / (2.0 * pi)
        target = Target(self._motion(angles, rate), ALL_BOUND, self._heading(angles, rate))
        return PositionMotion(target, context.behaviour.limits, Pace.WAITING)

    def _angle_of(self, place: Vector) -> float:
        return atan2(place[1] - self.order.center_enu_m[1], place[0] - self.order.center_enu_m[0])

    def _towards(self, wanted: float, context: TaskContext) -> float:
        maximum = _SHARE * context.behaviour.limits.acceleration_m_s2 * context.interval_s / self._radius_m
        return min(max(wanted, self._rate - maximum), self._rate + maximum)

    def _joins(self, context: TaskContext) -> bool:
        east, north, above = (p - c for p, c in zip(context.place, self.order.center_enu_m, strict=True))
        away = hypot(east, north)
        if abs(away - self._radius_m) > _ON_IT_M or abs(above) > _ON_IT_M:
            return False
        vx, vy, vz = context.velocity
        return abs(vx * east + vy * north) < _ON_IT_M_S * away and abs(vz) < _ON_IT_M_S

    def _speed_m_s(self, context: TaskContext) -> float:
        behaviour, ordered = context.behaviour, self.order.speed_m_s
        wanted = behaviour.limits.speed_m_s if ordered is None else ordered
        return min(wanted, behaviour.max_speed_m_s, sqrt(_SHARE * behaviour.limits.acceleration_m_s2 * self._radius_m))

    def _motion(self, angles: Array, rate: float) -> Array:
        motion = np.zeros((len(angles), 5, 3))
        east, north = self._radius_m * elementwise.cos(angles), self._radius_m * elementwise.sin(angles)
        for order in range(5):
            motion[:, order, 0], motion[:, order, 1] = east, north
            east, north = -rate * north, rate * east
        motion[:, 0] += self.order.center_enu_m
        return motion

    def _heading(self, angles: Array, rate: float) -> Array:
        heading = np.zeros((len(angles), 3))
        behaviour = self.order.yaw_behaviour
        if behaviour in (mav.ORBIT_YAW_BEHAVIOUR_HOLD_INITIAL_HEADING, mav.ORBIT_YAW_BEHAVIOUR_UNCHANGED):
            heading[:, 0] = self._first_yaw_rad
        elif behaviour == mav.ORBIT_YAW_BEHAVIOUR_HOLD_FRONT_TANGENT_TO_CIRCLE:
            heading[:, 0], heading[:, 1] = angles + self._turn * 0.5 * pi, rate
        else:
            heading[:, 0], heading[:, 1] = angles + pi, rate
        return heading
