"""How each mode begins to be flown, and how it goes on after the autopilot was killed in it."""

from dataclasses import dataclass

from colibri.autopilot.commander.missions import Missions
from colibri.autopilot.commander.pilot import Pilot
from colibri.autopilot.commander.rules.failsafe_table import Action
from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.commander.supervisor import Supervisor
from colibri.autopilot.commander.task_record import CourseRecord
from colibri.autopilot.control.loop import ControlLoop
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


@dataclass(slots=True)
class ModeCourses:
    """Makes the courses of one vehicle.

    Attributes:
        pilot: Flies them.
        supervisor: Says whether the place is known.
        missions: Have the course of a mission.
        loop: The control law, and the vehicle that it believes in.
        attitude: Leads attitude and thrust; None for a law that takes neither.
        instants: At which references are planned.
        references: How a track is planned, as the profile says it.
        first: A track that is flown from time 0 on, until it is begun; None for none.
    """

    pilot: Pilot
    supervisor: Supervisor
    missions: Missions
    loop: ControlLoop
    attitude: AttitudeReference | None
    instants: Instants
    references: References
    first: Track | None

    @property
    def first_yaw_rad(self) -> float:
        """Heading of the vehicle at time 0."""
        return start_yaw(self.first, self.references) if self.first else 0.0

    def begin(self, mode: Mode, scene: Scene) -> Course:
        """Return how a mode begins."""
        attitude = self.attitude
        if mode is Mode.TAKEOFF:
            behaviour = scene.behaviour
            return Climb(self.pilot.ground_m + behaviour.takeoff_height_m, None, scene, behaviour.takeoff_speed_m_s)
        if mode is Mode.LAND:
            return self._down()
        if mode is Mode.RETURN:
            return homeward(scene)
        if mode is Mode.MISSION:
            return self.missions.course()
        if mode is Mode.OFFBOARD:
            return Companion(attitude)
        if mode is Mode.FOLLOW:
            return Following()
        if mode is Mode.POSITION:
            return PositionSticks()
        if mode is Mode.TRACK:
            return self._on_track(scene)
        if mode is Mode.STABILIZED and attitude is not None:
            return Stabilized(attitude)
        if mode is Mode.ALTITUDE and attitude is not None:
            return AltitudeSticks(attitude, self.loop.vehicle.gravity_m_s2)
        return Stop()

    def again(self, record: CourseRecord, mode: Mode, scene: Scene) -> Course:
        """Return how a mode goes on after a restart in which `record` was flown."""
        if mode is Mode.TRACK and self.first is None and record.began_us is not None:
            chosen = track(scene.behaviour.track)
            return Along(self._plan(chosen), chosen.duration_s, record.began_us)
        if mode is Mode.MISSION:
            return self.missions.course_again(record.turns, record.legs)
        course = _ordered(mode, record, scene) or self.begin(mode, scene)
        return course.skip(record.legs) if isinstance(course, Legs) else course

    def _down(self) -> Course:
        """Return how to land: level, where nobody knows the place; a law that takes no attitude sinks where it is."""
        blind = self.pilot.saving is Action.DESCEND or not self.supervisor.knows_position
        if blind and self.attitude is not None:
            return Descent(self.attitude, self.loop.vehicle.gravity_m_s2)
        return landing(Land())

    def _on_track(self, scene: Scene) -> Course:
        if self.first is not None:
            first, self.first = self.first, None
            planner = self._plan(first)
            for_law = None if self.instants.rows is None else plan(first, self.references, self.loop.preview)
            self.pilot.reference = _at_start(planner, scene.now_us)
            return Along(planner, first.duration_s, 0, for_law)
        chosen = track(scene.behaviour.track)
        return to_track(self._plan(chosen), chosen.duration_s)

    def _plan(self, chosen: Track) -> Planner:
        return plan(chosen, self.references, self.instants.preview)


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
