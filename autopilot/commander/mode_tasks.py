"""How each mode begins to be flown, and how it goes on after the autopilot was killed in it."""

from collections.abc import Callable
from typing import TypeAlias

from colibri.autopilot.commander.missions import Missions
from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.commander.task_record import CourseRecord
from colibri.autopilot.control.interface import Preview
from colibri.autopilot.control.profile import References
from colibri.autopilot.guidance.attitude_reference import AttitudeReference
from colibri.autopilot.guidance.reference import Reference, target_of
from colibri.autopilot.guidance.sample_grid import Instants
from colibri.autopilot.guidance.tasks.attitude import AltitudeSticks, Descent, Stabilized
from colibri.autopilot.guidance.tasks.follow import Following
from colibri.autopilot.guidance.tasks.offboard import Companion
from colibri.autopilot.guidance.tasks.orbit import Round
from colibri.autopilot.guidance.tasks.orders import Circle, GoTo, Land, TakeOff, order_of
from colibri.autopilot.guidance.tasks.position import Along, Climb, Legs, Stop, Way, homeward, landing, to_track
from colibri.autopilot.guidance.tasks.sticks import PositionSticks
from colibri.autopilot.guidance.tasks.task import Course, Scene
from colibri.autopilot.guidance.trajectories.planner import Planner, plan, start_yaw
from colibri.autopilot.guidance.trajectories.tracks import Track, track
from colibri.plant.vehicle.description import Vehicle

TaskFactory: TypeAlias = Callable[[Scene], Course]
"""Says how a mode begins to be flown from a scene."""


class ModeTasks:
    """Makes the courses of one vehicle: a table of modes, and what each begins with."""

    def __init__(
        self,
        missions: Missions,
        attitude: AttitudeReference | None,
        vehicle: Vehicle,
        preview: Preview,
        instants: Instants,
        references: References,
        first: Track | None,
    ) -> None:
        """Make courses of these parts.

        Args:
            missions: Have the course of a mission.
            attitude: Leads attitude and thrust; None for a law that takes neither.
            vehicle: As the control law knows it.
            preview: The references that the law wants.
            instants: At which references are planned.
            references: How a track is planned, as the profile says it.
            first: A track that is flown from time 0 on, until it is begun; None for none.
        """
        self._missions = missions
        self._attitude = attitude
        self._gravity_m_s2 = vehicle.gravity_m_s2
        self._preview, self._instants = preview, instants
        self._references = references
        self._first = first
        self._factories: dict[Mode, TaskFactory] = {
            Mode.HOLD: lambda _: Stop(),
            Mode.TAKEOFF: climb,
            Mode.LAND: self._down,
            Mode.RETURN: homeward,
            Mode.MISSION: lambda _: missions.course(),
            Mode.OFFBOARD: lambda _: Companion(attitude),
            Mode.ORBIT: lambda _: Stop(),
            Mode.FOLLOW: lambda _: Following(),
            Mode.POSITION: lambda _: PositionSticks(),
            Mode.TRACK: self._on_track,
            Mode.STABILIZED: lambda _: Stop() if attitude is None else Stabilized(attitude),
            Mode.ALTITUDE: self._altitude,
        }

    @property
    def is_first(self) -> bool:
        """Whether a track is to be flown from time 0 on."""
        return self._first is not None

    @property
    def first_yaw_rad(self) -> float:
        """Heading of the vehicle at time 0."""
        return start_yaw(self._first, self._references) if self._first else 0.0

    def forget_first(self) -> None:
        """Fly no track from time 0 on: something else has been flown since."""
        self._first = None

    def adopt(self, vehicle: Vehicle) -> None:
        """Go by other numbers of the vehicle, from the next course on."""
        self._gravity_m_s2 = vehicle.gravity_m_s2

    def begin(self, mode: Mode, scene: Scene) -> Course:
        """Return how a mode begins."""
        return self._factories[mode](scene)

    def again(self, record: CourseRecord, mode: Mode, scene: Scene) -> Course:
        """Return how a mode goes on after a restart in which `record` was flown."""
        if mode is Mode.TRACK and self._first is None and record.began_us is not None:
            chosen = track(scene.behaviour.track)
            return Along(self._plan(chosen), chosen.duration_s, record.began_us)
        if mode is Mode.MISSION:
            return self._missions.course_again(record.turns, record.legs)
        course = _ordered(mode, record, scene) or self.begin(mode, scene)
        return course.skip(record.legs) if isinstance(course, Legs) else course

    def _altitude(self, scene: Scene) -> Course:
        del scene
        return Stop() if self._attitude is None else AltitudeSticks(self._attitude, self._gravity_m_s2)

    def _down(self, scene: Scene) -> Course:
        """Return how to land: level, where nobody knows the place; a law that takes no attitude sinks where it is."""
        if scene.blind and self._attitude is not None:
            return Descent(self._attitude, self._gravity_m_s2)
        return landing(Land())

    def _on_track(self, scene: Scene) -> Course:
        if self._first is not None:
            first, self._first = self._first, None
            planner = self._plan(first)
            for_law = None if self._instants.rows is None else plan(first, self._references, self._preview)
            return Along(planner, first.duration_s, 0, for_law, start=_at_start(planner, scene.now_us))
        chosen = track(scene.behaviour.track)
        return to_track(self._plan(chosen), chosen.duration_s)

    def _plan(self, chosen: Track) -> Planner:
        return plan(chosen, self._references, self._instants.preview)


def climb(scene: Scene) -> Course:
    """Return how to take off where no height is asked for."""
    behaviour = scene.behaviour
    return Climb(scene.ground_m + behaviour.takeoff_height_m, None, scene, behaviour.takeoff_speed_m_s)


def _ordered(mode: Mode, record: CourseRecord, scene: Scene) -> Course | None:
    """Return the course of an order that was flown in a mode; None where the mode itself says how it begins."""
    order = None if record.order is None else order_of(record.order)
    if mode is Mode.HOLD and isinstance(order, GoTo):
        return Way(order, scene)
    if mode is Mode.TAKEOFF and isinstance(order, TakeOff):
        return Climb(order.height_enu_m, order.yaw_rad, scene, scene.behaviour.takeoff_speed_m_s)
    if mode is Mode.ORBIT and isinstance(order, Circle):
        return Round(order, scene)
    return None


def _at_start(planner: Planner, now_us: int) -> Reference:
    """Return a reference that is on a track that began at time 0."""
    target = target_of(planner.horizon(now_us))
    return Reference(target.motion[0, :4].copy(), target.heading[0, :2].copy())
