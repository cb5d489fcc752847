"""Flight tasks by position."""

from collections.abc import Callable
from math import dist, hypot, inf, pi, radians, remainder, tau
from typing import TypeAlias

from colibri.autopilot.control.interface import Pace
from colibri.autopilot.guidance.integrator_chain import limited
from colibri.autopilot.guidance.reference import BindingDerivative, Reference, Target, still_target
from colibri.autopilot.guidance.tasks.orders import GoTo, Hold, Land, Order, TakeOff
from colibri.autopilot.guidance.tasks.task import (
    EndlessTask,
    FlightTask,
    PlannedMotion,
    PositionMotion,
    TaskContext,
    TaskOutput,
)
from colibri.autopilot.guidance.trajectories.planner import Planner
from colibri.common.kernels import atan2
from colibri.common.types import Vector

Leg: TypeAlias = Callable[[TaskContext], FlightTask]  # starts a task
_ALONG_BEYOND_M = 1.0  # shorter ways keep the heading
_THERE_M, _THERE_M_S = 0.3, 0.5  # distance and speed at arrival; the reference settles the rest
_REST_M_S, _REST_RAD_S = 0.05, 0.05
_FACING_RAD, _LEAD_RAD = radians(5.0), 0.5 * pi
_BELOW_FENCE = 0.9  # part of the height fence that a return climbs to
_LEAST_CLIMB_M = 2.5  # of a return within a cone (RTL_ABS_MIN_CLIMB)
_SKIMS_M_S, _CLEAR_M = 2.0, 1.0  # a vehicle that is faster, and lower above home, brakes with its feet off the ground
_FLARE_1_S, _FLARE_ABOVE_M = 0.5, 1.0  # descent speed per height, down to the landing speed at this height


class GoToTask:
    """Fly straight to a place, and stay."""

    def __init__(self, order: GoTo, context: TaskContext) -> None:
        self._place = order.position_enu_m
        self._speed_m_s = order.speed_m_s
        east, north = (order.position_enu_m[axis] - context.place[axis] for axis in (0, 1))
        along = atan2(north, east) if hypot(east, north) > _ALONG_BEYOND_M else context.yaw_rad
        self._yaw_rad = along if order.yaw_rad is None else order.yaw_rad
        self._target = still_target(self._place, self._yaw_rad, context.samples)
        there = abs(remainder(self._yaw_rad - context.yaw_rad, tau)) < _FACING_RAD
        self._turn = 0 if there else order.turn
        self._stay_s, self._since_us = order.stay_s, -1

    @property
    def order(self) -> GoTo:
        return GoTo(self._place, self._yaw_rad, self._speed_m_s, self._turn, self._stay_s)

    def update(self, context: TaskContext) -> PositionMotion:
        limits = context.behaviour.limits
        if self._speed_m_s is not None:
            limits = limited(limits, speed_m_s=min(self._speed_m_s, context.behaviour.max_speed_m_s))
        return PositionMotion(self._turning(context) if self._turn else self._target, limits, Pace.WAITING)

    def _turning(self, context: TaskContext) -> Target:
        """Lead the heading a quarter turn ahead, until the way that was ordered is the shorter one."""
        if (self._turn * (self._yaw_rad - context.yaw_rad)) % tau < _LEAD_RAD:
            self._turn = 0
            return self._target
        return still_target(self._place, context.yaw_rad + self._turn * _LEAD_RAD, context.samples)

    def arrived(self, context: TaskContext) -> bool:
        there = dist(context.state.position_enu_m, self._place) < _THERE_M and hypot(*context.velocity) < _THERE_M_S
        if not self._stay_s or not there:
            return there
        if self._since_us < 0:
            self._since_us = context.now_us
        return context.now_us - self._since_us >= self._stay_s * 1e6


class HoldTask:
    def __init__(self) -> None:
        self._place: Vector | None = None
        self._yaw_rad = 0.0
        self._target: Target | None = None

    @property
    def order(self) -> Order:
        return Hold() if self._place is None else GoTo(self._place, self._yaw_rad)

    def update(self, context: TaskContext) -> PositionMotion:
        limits = context.behaviour.limits
        if self._target is not None:
            return PositionMotion(self._target, limits)
        turning = abs(float(context.reference.heading[1])) > _REST_RAD_S
        if not turning and hypot(*context.velocity) < _REST_M_S:
            self._place, self._yaw_rad = context.place, context.yaw_rad
            self._target = still_target(self._place, self._yaw_rad, context.samples)
            return PositionMotion(self._target, limits)
        place, vertical = context.place, BindingDerivative.VELOCITY
        clear_m = context.home_enu_m[2] + _CLEAR_M
        if place[2] < clear_m and hypot(*context.velocity[:2]) > _SKIMS_M_S:
            place, vertical = (*place[:2], clear_m), BindingDerivative.POSITION
        kinds = (BindingDerivative.VELOCITY, BindingDerivative.VELOCITY, vertical)
        braking = still_target(place, context.yaw_rad, context.samples, kinds)
        return PositionMotion(braking._replace(turns=False), limits)

    def arrived(self, context: TaskContext) -> bool:
        del context
        return self._place is not None


class TakeoffTask:
    """Climb vertically, or stay if higher."""

    def __init__(
        self, height_enu_m: float, yaw_rad: float | None, context: TaskContext, speed_m_s: float | None = None
    ) -> None:
        self._height_m = max(height_enu_m, context.place[2])
        self._yaw_rad = context.yaw_rad if yaw_rad is None else yaw_rad
        self._speed_m_s = speed_m_s
        self._way: GoToTask | None = None

    @property
    def order(self) -> TakeOff:
        return TakeOff(self._height_m, self._yaw_rad)

    def update(self, context: TaskContext) -> PositionMotion:
        """Brake horizontally first."""
        limits = context.behaviour.limits
        if self._speed_m_s is not None:
            limits = limited(limits, climb_m_s=self._speed_m_s)
        if self._way is None:
            x, y, _ = context.place
            above = (x, y, self._height_m)
            if hypot(*context.velocity[:2]) >= _REST_M_S:
                kinds = (BindingDerivative.VELOCITY, BindingDerivative.VELOCITY, BindingDerivative.POSITION)
                return PositionMotion(still_target(above, self._yaw_rad, context.samples, kinds), limits)
            self._way = GoToTask(GoTo(above, self._yaw_rad), context)
        return PositionMotion(self._way.update(context).target, limits)

    def arrived(self, context: TaskContext) -> bool:
        return self._way is not None and self._way.arrived(context)


class LandTask(EndlessTask):
    """Sink vertically, slower near the ground."""

    def __init__(self, xy: tuple[float, float], yaw_rad: float | None) -> None:
        self._xy, self._yaw_rad = xy, yaw_rad

    def update(self, context: TaskContext) -> PositionMotion:
        behaviour = context.behaviour
        yaw = context.yaw_rad if self._yaw_rad is None else self._yaw_rad
        kinds = (BindingDerivative.POSITION, BindingDerivative.POSITION, BindingDerivative.VELOCITY)
        target = still_target((*self._xy, context.place[2]), yaw, context.samples, kinds)
        target.motion[:, 1, 2] = -sinking_m_s(context)
        return PositionMotion(target._replace(turns=self._yaw_rad is not None), behaviour.limits)


def sinking_m_s(context: TaskContext) -> float:
    behaviour, above_m = context.behaviour, context.place[2] - context.home_enu_m[2]
    if behaviour.land_slow_below_m > 0.0:
        fast_m_s = behaviour.land_high_m_s or behaviour.limits.sink_m_s
        return fast_m_s if above_m > behaviour.land_slow_below_m else behaviour.land_speed_m_s
    flare = _FLARE_1_S * (above_m - _FLARE_ABOVE_M)
    return min(max(flare, behaviour.land_speed_m_s), behaviour.limits.sink_m_s)


class TaskSequence:
    def __init__(self, first: Leg, *others: Leg) -> None:
        self._ahead = [first, *others]
        self._inner: tuple[int, ...] = ()
        self.task: FlightTask | None = None

    @property
    def left(self) -> tuple[int, ...]:
        """Remaining legs with the current one, then those of a nested sequence."""
        inner = self.task.left if isinstance(self.task, TaskSequence) else ()
        return (len(self._ahead) + (self.task is not None), *inner)

    def skip(self, left: tuple[int, ...]) -> "TaskSequence":
        if left:
            self._ahead = self._ahead[max(len(self._ahead) - left[0], 0) :]
            self._inner = left[1:]
        return self

    def update(self, context: TaskContext) -> TaskOutput:
        if self.task is None or (self._ahead and self.task.arrived(context)):
            self.task = self._ahead.pop(0)(context)
            if isinstance(self.task, TaskSequence):
                self.task.skip(self._inner)
            self._inner = ()
        return self.task.update(context)

    def arrived(self, context: TaskContext) -> bool:
        return not self._ahead and self.task is not None and self.task.arrived(context)


class TrackTask:
    """A track; `start` is the reference at a start in mid-flight."""

    def __init__(
        self,
        planner: Planner,
        duration_s: float,
        began_us: int,
        planner_for_law: Planner | None = None,
        start: Reference | None = None,
    ) -> None:
        self.start, self.began_us = start, began_us
        self._planner, self._planner_for_law, self._duration_s = planner, planner_for_law, duration_s

    def update(self, context: TaskContext) -> PlannedMotion:
        since_us = context.now_us - self.began_us
        grid_us = self._planner.preview.interval_us
        for_law = self._planner_for_law.horizon_at(since_us, grid_us) if self._planner_for_law else None
        return PlannedMotion(self._planner.horizon_at(since_us, grid_us), context.behaviour.limits, for_law)

    def arrived(self, context: TaskContext) -> bool:
        return context.now_us - self.began_us > self._duration_s * 1e6


def landing(order: Land) -> TaskSequence:
    place, yaw_rad = order
    if place is None:
        return TaskSequence(lambda _: HoldTask(), lambda context: LandTask(context.place[:2], yaw_rad))
    x, y, _ = place
    return TaskSequence(
        lambda context: GoToTask(GoTo((x, y, context.place[2]), yaw_rad), context), lambda _: LandTask((x, y), yaw_rad)
    )


def homeward(context: TaskContext, place: Vector) -> TaskSequence:
    """Climb if home or a rally point is far, fly there, land; of the fence only the height restricts a return.

    On the ground, stay there, as PX4 and ArduCopter do.
    """
    if context.standing:
        return landing(Land())
    x, y, z = place
    behaviour, home_m = context.behaviour, context.home_enu_m[2]
    if behaviour.return_delay_s or behaviour.return_final_m or behaviour.return_cone:
        return _homeward_in_steps(context, place)
    down = landing(Land((x, y, z)))
    if hypot(x - context.place[0], y - context.place[1]) <= behaviour.return_radius_m:
        return down
    high_m = max(home_m + behaviour.return_height_m, z)
    if behaviour.max_height_m > 0.0:
        high_m = min(high_m, home_m + _BELOW_FENCE * behaviour.max_height_m)
    return TaskSequence(lambda begin: TakeoffTask(high_m, None, begin), lambda _: down)


def _homeward_in_steps(context: TaskContext, place: Vector) -> TaskSequence:
    """Climb within a cone, fly home, wait there, land or stay: ArduCopter's mode_rtl.cpp."""
    x, y, z = place
    behaviour, (east, north, up), home_m = context.behaviour, context.place, context.home_enu_m[2]
    away_m, high_m = hypot(x - east, y - north), max(z, home_m + behaviour.return_height_m)
    high_m = max(high_m, up + behaviour.return_climb_m)
    if behaviour.return_cone:
        high_m = max(up, min(high_m, max(home_m + away_m * behaviour.return_cone, up + _LEAST_CLIMB_M)))
    if behaviour.max_height_m > 0.0:
        high_m = max(up, min(high_m, home_m + _BELOW_FENCE * behaviour.max_height_m))
    speed = behaviour.return_speed_m_s or None
    outward = atan2(y - north, x - east) if behaviour.return_faces and away_m > _ALONG_BEYOND_M else None
    there, final = (x, y, high_m), (x, y, home_m + behaviour.return_final_m)
    home_yaw = context.home_yaw_rad if behaviour.return_faces else context.yaw_rad
    legs: list[Leg] = [
        lambda begin: GoToTask(GoTo(there, begin.yaw_rad if outward is None else outward, speed), begin),
        lambda begin: GoToTask(GoTo(there, home_yaw, speed, stay_s=behaviour.return_delay_s), begin),
    ]
    if behaviour.return_final_m > 0.0:
        legs.append(lambda begin: GoToTask(GoTo(final, home_yaw, stay_s=inf), begin))
    else:
        legs.append(lambda _: LandTask((x, y), home_yaw))
    return TaskSequence(lambda begin: TakeoffTask(high_m, None, begin), *legs)


def to_track(planner: Planner, duration_s: float) -> TaskSequence:
    """Fly to a track's first point, then along it."""
    first = planner.horizon(0)
    x, y, z = first.position_enu_m[0].tolist()
    yaw_rad = float(first.yaw_rad[0])
    return TaskSequence(
        lambda context: TakeoffTask(z, None, context),
        lambda context: GoToTask(GoTo((x, y, z), yaw_rad), context),
        lambda context: TrackTask(planner, duration_s, context.now_us),
    )
