"""Courses: how each order is flown, as a target for the reference to follow, sample after sample."""

from math import atan2, copysign, cos, hypot, pi, sin, sqrt
from typing import NamedTuple, Protocol

import numpy as np

from autopilot.behaviour import Behaviour
from autopilot.controller import AttitudeDemand, Horizon, VehicleState
from autopilot.orders import Circle, GoTo, Land
from autopilot.planner import Planner
from autopilot.reference import ALL_BOUND, Kind, Reference, Target, still_target, target_of
from autopilot.reference_chain import Limits
from mavlink.dialect import mav
from mavlink.frames import Vector
from mavlink.setpoints import OffboardSetpoint, Sticks, TargetState

_ALONG_BEYOND_M = 1.0
"""A way shorter than this does not turn the vehicle."""
_SLOW_M_S = 0.05
_LIFT_M, _LIFT_M_S = 0.15, 0.05
_CIRCLE_SHARE = 0.8
"""Part of the horizontal acceleration that a circle may need."""


class Steered(NamedTuple):
    """What clients ask for from moment to moment; None where nobody does.

    Attributes:
        sticks: Of a pilot.
        setpoint: Of an offboard companion, in ENU.
        leader: What is to be followed.
    """

    sticks: Sticks | None = None
    setpoint: OffboardSetpoint | None = None
    leader: TargetState | None = None


NOT_STEERED = Steered()


class Scene(NamedTuple):
    """What a course sees.

    Attributes:
        now_us: Simulated time.
        state: The vehicle.
        reference: Where the reference stands.
        home_enu_m: Where the vehicle took off.
        behaviour: The numbers that it flies by.
        interval_s: Between two instants of a target.
        samples: How many instants a target has.
        steered: What clients ask for from moment to moment.
    """

    now_us: int
    state: VehicleState
    reference: Reference
    home_enu_m: Vector
    behaviour: Behaviour
    interval_s: float
    samples: int
    steered: Steered = NOT_STEERED

    @property
    def yaw_rad(self) -> float:
        """Heading of the reference."""
        return float(self.reference.heading[0])

    @property
    def place(self) -> Vector:
        """Position of the reference."""
        x, y, z = self.reference.motion[0].tolist()
        return (x, y, z)


class Motion(NamedTuple):
    """A course by position and yaw.

    Attributes:
        target: What the reference is to become.
        limits: How fast.
    """

    target: Target
    limits: Limits


class Planned(NamedTuple):
    """A course along a plan.

    Attributes:
        horizon: What the reference is to become.
        limits: How fast, until it is that.
    """

    horizon: Horizon
    limits: Limits

    @property
    def target(self) -> Target:
        """The plan as a target."""
        return target_of(self.horizon)


class Lean(NamedTuple):
    """A course by attitude and thrust.

    Attributes:
        demand: What the control law is to hold.
        reference: Where the reference stands meanwhile.
        lifts: Whether a vehicle that stands must leave the ground for it.
        sinks: Whether a vehicle in the air must sink.
    """

    demand: AttitudeDemand
    reference: Reference
    lifts: bool
    sinks: bool


class Course(Protocol):
    """A way to fly."""

    def ask(self, scene: Scene) -> Motion | Planned | Lean:
        """Return what is to be flown from now on. Called once a control sample."""
        ...

    def arrived(self, scene: Scene) -> bool:
        """Whether it is flown to its end."""
        ...


def lifts(target: Target, state: VehicleState) -> bool:
    """Whether a vehicle that stands must leave the ground for this target."""
    end = target.motion[-1, :, 2]
    kind = target.kinds[2]
    if kind is Kind.POSITION:
        return bool(end[0] > state.position_enu_m[2] + _LIFT_M)
    return bool(end[1 if kind is Kind.VELOCITY else 2] > _LIFT_M_S)


class Way:
    """Straight to a place, and stay."""

    def __init__(self, order: GoTo, scene: Scene) -> None:
        """Begin where the reference is."""
        self._place = order.position_enu_m
        self._speed_m_s = order.speed_m_s
        east, north = (order.position_enu_m[axis] - scene.place[axis] for axis in (0, 1))
        along = atan2(north, east) if hypot(east, north) > _ALONG_BEYOND_M else scene.yaw_rad
        self._yaw_rad = along if order.yaw_rad is None else order.yaw_rad

    def ask(self, scene: Scene) -> Motion:
        """Return the place."""
        limits = scene.behaviour.limits
        if self._speed_m_s is not None:
            limits = limits._replace(speed_m_s=min(self._speed_m_s, scene.behaviour.fastest_m_s))
        return Motion(still_target(self._place, self._yaw_rad, scene.samples), limits)

    def arrived(self, scene: Scene) -> bool:
        """Whether the vehicle is there, and slow."""
        away = _distance(scene.state.position_enu_m, self._place)
        return away < scene.behaviour.acceptance_m and _speed(scene.reference) < 10.0 * _SLOW_M_S


class Climb:
    """Straight up (or down) to a height."""

    def __init__(self, height_enu_m: float, yaw_rad: float | None, scene: Scene) -> None:
        """Begin where the reference is."""
        x, y, _ = scene.place
        self._way = Way(GoTo((x, y, height_enu_m), scene.yaw_rad if yaw_rad is None else yaw_rad), scene)

    def ask(self, scene: Scene) -> Motion:
        """Return the height above where it began."""
        target, limits = self._way.ask(scene)
        return Motion(target, limits._replace(climb_m_s=scene.behaviour.takeoff_speed_m_s))

    def arrived(self, scene: Scene) -> bool:
        """Whether the vehicle is there, and slow."""
        return self._way.arrived(scene)


class Stop:
    """Stop, and stay where that is."""

    def __init__(self) -> None:
        """Begin to brake."""
        self._place: Vector | None = None
        self._yaw_rad = 0.0

    def ask(self, scene: Scene) -> Motion:
        """Return rest: of the velocity first, then of the place that it led to."""
        turning = abs(float(scene.reference.heading[1])) > _SLOW_M_S
        if self._place is None and not turning and _speed(scene.reference) < _SLOW_M_S:
            self._place, self._yaw_rad = scene.place, scene.yaw_rad
        if self._place is not None:
            return Motion(still_target(self._place, self._yaw_rad, scene.samples), scene.behaviour.limits)
        braking = still_target(scene.place, scene.yaw_rad, scene.samples, (Kind.VELOCITY,) * 3)
        return Motion(braking._replace(turns=False), scene.behaviour.limits)

    def arrived(self, scene: Scene) -> bool:
        """Whether it stands."""
        del scene
        return self._place is not None


class Sink:
    """Above a place first, then down until something else ends it."""

    def __init__(self, order: Land, scene: Scene) -> None:
        """Begin where the reference is."""
        x, y, _ = order.position_enu_m or scene.place
        self._way = Way(GoTo((x, y, scene.place[2]), order.yaw_rad), scene)
        self._above = order.position_enu_m is None
        self._stop = Stop() if self._above else None
        self._xy = (x, y)

    def ask(self, scene: Scene) -> Motion:
        """Return the way there, then a descent that slows down towards the ground."""
        if self._stop is not None and not self._stop.arrived(scene):
            self._xy = scene.place[:2]
            target, limits = self._stop.ask(scene)
            if not self._stop.arrived(scene):
                return Motion(self._sinking(scene, target), limits)
        self._above = self._above or self._way.arrived(scene)
        if not self._above:
            return self._way.ask(scene)
        target = still_target((*self._xy, scene.place[2]), scene.yaw_rad, scene.samples)
        return Motion(self._sinking(scene, target), scene.behaviour.limits)

    @staticmethod
    def _sinking(scene: Scene, target: Target) -> Target:
        behaviour = scene.behaviour
        height_m = scene.place[2] - scene.home_enu_m[2]
        speed = min(max(0.5 * (height_m - 1.0), behaviour.land_speed_m_s), behaviour.limits.sink_m_s)
        target.motion[:, 1, 2] = -speed
        return target._replace(kinds=(target.kinds[0], target.kinds[1], Kind.VELOCITY), turns=False)

    def arrived(self, scene: Scene) -> bool:
        """Never by itself: the ground ends it."""
        del scene
        return False


class Homeward:
    """Climb, fly home, land there."""

    def __init__(self, scene: Scene) -> None:
        """Begin where the reference is."""
        x, y, z = scene.place
        home = scene.home_enu_m
        far = hypot(x - home[0], y - home[1]) > scene.behaviour.return_radius_m
        height_m = max(z, home[2] + scene.behaviour.return_height_m) if far else z
        self._legs: list[Course] = [Climb(height_m, None, scene)] if height_m > z else []
        self._home = (home[0], home[1], height_m)
        self._far = far

    def ask(self, scene: Scene) -> Motion | Planned | Lean:
        """Return the target of the leg that is flown now."""
        while not self._legs or self._legs[0].arrived(scene):
            self._legs = [self._next_leg(scene)]
        return self._legs[0].ask(scene)

    def _next_leg(self, scene: Scene) -> Course:
        if self._far:
            self._far = False
            return Way(GoTo(self._home), scene)
        return Sink(Land((self._home[0], self._home[1], scene.place[2])), scene)

    def arrived(self, scene: Scene) -> bool:
        """Never by itself: the ground ends it."""
        del scene
        return False


class Round:
    """Around a centre: to the nearest point of the circle, then along it.

    Attributes:
        turns: How often it went around.
    """

    def __init__(self, order: Circle, scene: Scene) -> None:
        """Begin where the reference is."""
        self._order = order
        x, y, z = order.center_enu_m
        self._radius_m = abs(order.radius_m)
        away = hypot(scene.place[0] - x, scene.place[1] - y)
        self._angle = atan2(scene.place[1] - y, scene.place[0] - x) if away > 0.0 else 0.0
        entry = (x + self._radius_m * cos(self._angle), y + self._radius_m * sin(self._angle), z)
        self._first_yaw_rad = scene.yaw_rad
        self._way = Way(GoTo(entry), scene)
        self._began_us: int | None = None
        self.turns = 0.0

    def ask(self, scene: Scene) -> Motion:
        """Return the way to the circle, then the motion along it."""
        if self._began_us is None and not self._way.arrived(scene):
            return self._way.ask(scene)
        if self._began_us is None:
            self._began_us = scene.now_us
        fastest = sqrt(_CIRCLE_SHARE * scene.behaviour.limits.acceleration_m_s2 * self._radius_m)
        wanted = scene.behaviour.limits.speed_m_s if self._order.speed_m_s is None else self._order.speed_m_s
        rate = -min(wanted, fastest, scene.behaviour.fastest_m_s) / self._radius_m
        rate = rate if self._order.radius_m > 0.0 else -rate
        since_s = (scene.now_us - self._began_us) * 1e-6
        self.turns = abs(rate) * since_s / (2.0 * pi)
        angles = self._angle + rate * (since_s + scene.interval_s * np.arange(scene.samples))
        motion = np.zeros((scene.samples, 5, 3))
        spoke = self._radius_m * np.exp(1j * angles)
        for order in range(5):
            motion[:, order, 0], motion[:, order, 1] = spoke.real, spoke.imag
            spoke = spoke * 1j * rate
        motion[:, 0] += self._order.center_enu_m
        heading = np.zeros((scene.samples, 3))
        behaviour = self._order.yaw_behaviour
        if behaviour in (mav.ORBIT_YAW_BEHAVIOUR_HOLD_INITIAL_HEADING, mav.ORBIT_YAW_BEHAVIOUR_UNCHANGED):
            heading[:, 0] = self._first_yaw_rad
        elif behaviour == mav.ORBIT_YAW_BEHAVIOUR_HOLD_FRONT_TANGENT_TO_CIRCLE:
            heading[:, 0], heading[:, 1] = angles + copysign(0.5 * pi, rate), rate
        else:
            heading[:, 0], heading[:, 1] = angles + pi, rate
        return Motion(Target(motion, ALL_BOUND, heading), scene.behaviour.limits)

    def arrived(self, scene: Scene) -> bool:
        """Never by itself."""
        del scene
        return False


class OnTrack:
    """A track, from its first point on."""

    def __init__(self, planner: Planner, duration_s: float, scene: Scene, *, at_once: bool = False) -> None:
        """Fly to where the track begins; `at_once`: it began at time 0, wherever the vehicle is."""
        self._planner = planner
        self._duration_s = duration_s
        first = planner.horizon(0)
        x, y, z = first.position_enu_m[0].tolist()
        self._way = Way(GoTo((x, y, z), float(first.yaw_rad[0])), scene)
        self._began_us = 0 if at_once else None

    def ask(self, scene: Scene) -> Motion | Planned:
        """Return the way to its first point, then the track."""
        if self._began_us is None:
            if not self._way.arrived(scene):
                return self._way.ask(scene)
            self._began_us = scene.now_us
        return Planned(self._planner.horizon(scene.now_us - self._began_us), scene.behaviour.limits)

    def arrived(self, scene: Scene) -> bool:
        """Whether the track has ended."""
        return self._began_us is not None and scene.now_us - self._began_us > self._duration_s * 1e6


def _distance(a: Vector, b: Vector) -> float:
    return sqrt(sum((one - other) ** 2 for one, other in zip(a, b, strict=True)))


def _speed(reference: Reference) -> float:
    x, y, z = reference.motion[1].tolist()
    return sqrt(x * x + y * y + z * z)
