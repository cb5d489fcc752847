"""Courses by place: how each order is flown, as a target for the reference to follow, sample after sample."""

from collections.abc import Callable
from math import dist, hypot
from typing import TypeAlias

from colibri.autopilot.guidance.reference import Kind, Reference, still_target
from colibri.autopilot.guidance.tasks.orders import GoTo, Hold, Land, Order, TakeOff
from colibri.autopilot.guidance.tasks.task import Asked, Course, Endless, Motion, Planned, Scene
from colibri.autopilot.guidance.trajectories.planner import Planner
from colibri.common.kernels import atan2
from colibri.common.types import Vector

Leg: TypeAlias = Callable[[Scene], Course]
"""Begins a course where the scene is."""

_ALONG_BEYOND_M = 1.0
"""A way shorter than this does not turn the vehicle."""
_THERE_M, _THERE_M_S = 0.3, 0.5
"""So close to a place, and so slow, the vehicle is there: the rest is for the reference to settle."""
_REST_M_S = 0.05
_REST_RAD_S = 0.05
_FLARE_1_S, _FLARE_ABOVE_M = 0.5, 1.0
"""A descent slows down in proportion to the height, to the speed of landings at this height."""


class Way:
    """Straight to a place, and stay."""

    def __init__(self, order: GoTo, scene: Scene) -> None:
        """Begin where the reference is."""
        self._place = order.position_enu_m
        self._speed_m_s = order.speed_m_s
        east, north = (order.position_enu_m[axis] - scene.place[axis] for axis in (0, 1))
        along = atan2(north, east) if hypot(east, north) > _ALONG_BEYOND_M else scene.yaw_rad
        self._yaw_rad = along if order.yaw_rad is None else order.yaw_rad

    @property
    def order(self) -> GoTo:
        """What it flies: by this it can begin again."""
        return GoTo(self._place, self._yaw_rad, self._speed_m_s)

    def ask(self, scene: Scene) -> Motion:
        """Return the place."""
        limits = scene.behaviour.limits
        if self._speed_m_s is not None:
            limits = limits._replace(speed_m_s=min(self._speed_m_s, scene.behaviour.max_speed_m_s))
        return Motion(still_target(self._place, self._yaw_rad, scene.samples), limits)

    def arrived(self, scene: Scene) -> bool:
        """Whether the vehicle is there, and slow."""
        return dist(scene.state.position_enu_m, self._place) < _THERE_M and hypot(*scene.velocity) < _THERE_M_S


class Stop:
    """Stop, and stay where that is."""

    def __init__(self) -> None:
        """Begin to brake."""
        self._place: Vector | None = None
        self._yaw_rad = 0.0

    @property
    def order(self) -> Order:
        """What it flies: by this it can begin again."""
        return Hold() if self._place is None else GoTo(self._place, self._yaw_rad)

    def ask(self, scene: Scene) -> Motion:
        """Return rest: of the velocity first, then of the place that it led to."""
        turning = abs(float(scene.reference.heading[1])) > _REST_RAD_S
        if self._place is None and not turning and hypot(*scene.velocity) < _REST_M_S:
            self._place, self._yaw_rad = scene.place, scene.yaw_rad
        if self._place is not None:
            return Motion(still_target(self._place, self._yaw_rad, scene.samples), scene.behaviour.limits)
        braking = still_target(scene.place, scene.yaw_rad, scene.samples, (Kind.VELOCITY,) * 3)
        return Motion(braking._replace(turns=False), scene.behaviour.limits)

    def arrived(self, scene: Scene) -> bool:
        """Whether it stands."""
        del scene
        return self._place is not None


class Climb:
    """Straight up to a height, above where the reference comes to rest; one that is higher already stays there."""

    def __init__(
        self, height_enu_m: float, yaw_rad: float | None, scene: Scene, speed_m_s: float | None = None
    ) -> None:
        """Begin where the reference is; climb at `speed_m_s`, or as fast as the parameters say."""
        self._height_m = max(height_enu_m, scene.place[2])
        self._yaw_rad = scene.yaw_rad if yaw_rad is None else yaw_rad
        self._speed_m_s = speed_m_s
        self._way: Way | None = None

    @property
    def order(self) -> TakeOff:
        """What it flies: by this it can begin again."""
        return TakeOff(self._height_m, self._yaw_rad)

    def ask(self, scene: Scene) -> Motion:
        """Return the height, and rest in the plane until that is reached."""
        x, y, _ = scene.place
        if self._way is None and hypot(*scene.velocity[:2]) < _REST_M_S:
            self._way = Way(GoTo((x, y, self._height_m), self._yaw_rad), scene)
        if self._way is None:
            kinds = (Kind.VELOCITY, Kind.VELOCITY, Kind.POSITION)
            target = still_target((x, y, self._height_m), self._yaw_rad, scene.samples, kinds)
            limits = scene.behaviour.limits
        else:
            target, limits = self._way.ask(scene)
        return Motion(target, limits if self._speed_m_s is None else limits._replace(climb_m_s=self._speed_m_s))

    def arrived(self, scene: Scene) -> bool:
        """Whether the vehicle is there, and slow."""
        return self._way is not None and self._way.arrived(scene)


class Sink(Endless):
    """Straight down, slower towards the ground, until that ends it."""

    def __init__(self, xy: tuple[float, float], yaw_rad: float | None) -> None:
        """Sink onto a point, heading as now where `yaw_rad` is None."""
        self._xy = xy
        self._yaw_rad = yaw_rad

    def ask(self, scene: Scene) -> Motion:
        """Return a descent."""
        behaviour = scene.behaviour
        yaw = scene.yaw_rad if self._yaw_rad is None else self._yaw_rad
        kinds = (Kind.POSITION, Kind.POSITION, Kind.VELOCITY)
        target = still_target((*self._xy, scene.place[2]), yaw, scene.samples, kinds)
        target.motion[:, 1, 2] = -sinking_m_s(scene)
        return Motion(target._replace(turns=self._yaw_rad is not None), behaviour.limits)


def sinking_m_s(scene: Scene) -> float:
    """Return how fast to sink at this height, m/s."""
    flare = _FLARE_1_S * (scene.place[2] - scene.home_enu_m[2] - _FLARE_ABOVE_M)
    return min(max(flare, scene.behaviour.land_speed_m_s), scene.behaviour.limits.sink_m_s)


class Legs:
    """Courses one after another, each from where the one before has led.

    Attributes:
        course: The one that is flown; None before the first sample.
    """

    def __init__(self, first: Leg, *others: Leg) -> None:
        """Begin with the first at the first sample."""
        self._ahead = [first, *others]
        self._inner: tuple[int, ...] = ()
        self.course: Course | None = None

    @property
    def left(self) -> tuple[int, ...]:
        """How many legs are left from the one that is flown on; then the same of that, where it has legs itself."""
        inner = self.course.left if isinstance(self.course, Legs) else ()
        return (len(self._ahead) + (self.course is not None), *inner)

    def skip(self, left: tuple[int, ...]) -> "Legs":
        """Begin with the leg after which so many are left, itself among them; return this."""
        if left:
            self._ahead = self._ahead[max(len(self._ahead) - left[0], 0) :]
            self._inner = left[1:]
        return self

    def ask(self, scene: Scene) -> Asked:
        """Return what the leg that is flown now asks for."""
        if self.course is None or (self._ahead and self.course.arrived(scene)):
            self.course = self._ahead.pop(0)(scene)
            if isinstance(self.course, Legs):
                self.course.skip(self._inner)
            self._inner = ()
        return self.course.ask(scene)

    def arrived(self, scene: Scene) -> bool:
        """Whether the last leg is flown to its end."""
        return not self._ahead and self.course is not None and self.course.arrived(scene)


class Along:
    """A track, from a moment on; past its end, its last point.

    Attributes:
        began_us: That moment.
        start: Where the reference is set as the track is begun in mid-flight; None where it is led there.
    """

    def __init__(
        self,
        planner: Planner,
        duration_s: float,
        began_us: int,
        planner_for_law: Planner | None = None,
        start: Reference | None = None,
    ) -> None:
        """Fly a track that began, or begins, at `began_us`.

        A control law that previews references other than a control sample apart has a planner of its own.
        """
        self.start = start
        self._planner = planner
        self._planner_for_law = planner_for_law
        self._duration_s = duration_s
        self.began_us = began_us

    def ask(self, scene: Scene) -> Planned:
        """Return the track."""
        since_us = scene.now_us - self.began_us
        for_law = self._planner_for_law.horizon(since_us) if self._planner_for_law else None
        return Planned(self._planner.horizon(since_us), scene.behaviour.limits, for_law)

    def arrived(self, scene: Scene) -> bool:
        """Whether the track has ended."""
        return scene.now_us - self.began_us > self._duration_s * 1e6


def landing(order: Land) -> Legs:
    """Return how to land: above the place first, or at rest, then down."""
    place, yaw_rad = order
    if place is None:
        return Legs(lambda _: Stop(), lambda scene: Sink(scene.place[:2], yaw_rad))
    x, y, _ = place
    return Legs(
        lambda scene: Way(GoTo((x, y, scene.place[2]), yaw_rad), scene),
        lambda _: Sink((x, y), yaw_rad),
    )


def homeward(scene: Scene) -> Legs:
    """Return how to return: up where home is far, there, and down.

    Nothing holds a return back, neither the geofence nor how far it is: there is no better place to go.
    """
    x, y, z = scene.home_enu_m
    down = landing(Land((x, y, z)))
    if hypot(x - scene.place[0], y - scene.place[1]) <= scene.behaviour.return_radius_m:
        return down
    high_m = z + scene.behaviour.return_height_m
    return Legs(lambda begin: Climb(high_m, None, begin), lambda _: down)


def to_track(planner: Planner, duration_s: float) -> Legs:
    """Return how to fly a track from wherever the vehicle is: up to its first point's height, there, and along it."""
    first = planner.horizon(0)
    x, y, z = first.position_enu_m[0].tolist()
    yaw_rad = float(first.yaw_rad[0])
    return Legs(
        lambda scene: Climb(z, None, scene),
        lambda scene: Way(GoTo((x, y, z), yaw_rad), scene),
        lambda scene: Along(planner, duration_s, scene.now_us),
    )
