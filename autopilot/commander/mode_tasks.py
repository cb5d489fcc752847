"""The first task of each mode, and its continuation after a restart."""

from collections.abc import Callable, Mapping
from typing import TypeAlias

from colibri.autopilot.commander.missions import Missions, MissionTask, task_of
from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.control.interface import Preview
from colibri.autopilot.control.profile import References
from colibri.autopilot.guidance.attitude_reference import AttitudeReference
from colibri.autopilot.guidance.guidance import Instants
from colibri.autopilot.guidance.reference import Reference, target_of
from colibri.autopilot.guidance.tasks.attitude import AltitudeTask, DescentTask, StabilizedTask
from colibri.autopilot.guidance.tasks.follow import FollowTargetTask
from colibri.autopilot.guidance.tasks.guided import GuidedSettings, GuidedTask
from colibri.autopilot.guidance.tasks.offboard import OffboardTask
from colibri.autopilot.guidance.tasks.orbit import OrbitTask
from colibri.autopilot.guidance.tasks.orders import GoTo, Land, Orbit, Order, OrderRecord, TakeOff, order_of, record_of
from colibri.autopilot.guidance.tasks.position import (
    GoToTask,
    HoldTask,
    TakeoffTask,
    TaskSequence,
    TrackTask,
    landing,
    to_track,
)
from colibri.autopilot.guidance.tasks.sticks import PositionTask
from colibri.autopilot.guidance.tasks.task import FlightTask, TaskContext
from colibri.autopilot.guidance.trajectories.planner import Planner, start_yaw
from colibri.autopilot.guidance.trajectories.registry import track
from colibri.autopilot.guidance.trajectories.tracks import Track
from colibri.common.records import Record
from colibri.mavlink.node.budget import Budget
from colibri.plant.vehicle.description import Vehicle

_TRACK_US = 6000.0  # work to tabulate a track
TaskFactory: TypeAlias = Callable[[TaskContext], FlightTask]
"""First task of a mode."""


class TaskRecord(Record, frozen=True):
    """State of a task for the checkpoint; `legs` are those that remain."""

    order: OrderRecord | None = None
    began_us: int | None = None
    turns: float = 0.0
    legs: tuple[int, ...] = ()


_ORDERED = (GoToTask, OrbitTask, TakeoffTask, HoldTask, GuidedTask)  # tasks restarted by an order
_AGAIN: Mapping[Mode, tuple[type[Order], ...]] = {
    Mode.HOLD: (GoTo, TakeOff),  # a take-off that has arrived settles in hold
    Mode.TAKEOFF: (TakeOff,),
    Mode.ORBIT: (Orbit,),
}
"""Orders that a mode may have flown."""


def task_record(task: FlightTask) -> TaskRecord:
    if isinstance(task, MissionTask):
        return TaskRecord(turns=task.turns, legs=task.legs)
    if isinstance(task, TaskSequence):
        return task_record(task.task) if isinstance(task.task, TrackTask) else TaskRecord(legs=task.left)
    if isinstance(task, TrackTask):
        return TaskRecord(began_us=task.began_us)
    if isinstance(task, _ORDERED):
        return TaskRecord(record_of(task.order))
    return TaskRecord()


class ModeTasks:
    def __init__(
        self,
        missions: Missions,
        attitude: AttitudeReference | None,
        vehicle: Vehicle,
        preview: Preview,
        instants: Instants,
        references: References,
        first: Track | None,
        budget: Budget,
    ) -> None:
        """`attitude` is None for a law without attitude setpoints; `first` is a track flown from time 0."""
        self._missions = missions
        self._attitude = attitude
        self._gravity_m_s2 = vehicle.gravity_m_s2
        self._preview, self._instants = preview, instants
        self._references = references
        self.first, self._budget = first, budget
        self._factories: dict[Mode, TaskFactory] = {
            Mode.HOLD: lambda _: HoldTask(),
            Mode.TAKEOFF: climb,
            Mode.LAND: self._down,
            Mode.RETURN: missions.homeward,
            Mode.MISSION: lambda _: missions.task(),
            Mode.OFFBOARD: lambda _: OffboardTask(attitude),
            Mode.ORBIT: lambda _: HoldTask(),
            Mode.FOLLOW: lambda _: FollowTargetTask(),
            Mode.POSITION: lambda _: PositionTask(),
            Mode.TRACK: self._on_track,
            Mode.STABILIZED: lambda _: StabilizedTask(attitude) if attitude else HoldTask(),
            Mode.ALTITUDE: lambda _: AltitudeTask(attitude, self._gravity_m_s2) if attitude else HoldTask(),
        }

    @property
    def first_yaw_rad(self) -> float:
        return start_yaw(self.first, self._references) if self.first else 0.0

    def adopt(self, vehicle: Vehicle) -> None:
        self._gravity_m_s2 = vehicle.gravity_m_s2

    def begin(self, mode: Mode, context: TaskContext) -> FlightTask:
        return self._factories[mode](context)

    def guided(self, settings: Callable[[], GuidedSettings]) -> GuidedTask:
        return GuidedTask(self._attitude, self._gravity_m_s2, settings)

    def again(self, record: TaskRecord, mode: Mode, context: TaskContext) -> FlightTask:
        if mode is Mode.TRACK and self.first is None and record.began_us is not None:
            chosen = track(context.behaviour.track)
            return TrackTask(self._plan(chosen), chosen.duration_s, record.began_us)
        if mode is Mode.MISSION:
            return self._missions.task_again(record.turns, record.legs)
        order = None if record.order is None else order_of(record.order)
        if order is not None and isinstance(order, _AGAIN.get(mode, ())):
            return task_of(order, context, context.behaviour.takeoff_speed_m_s)
        task = self.begin(mode, context)
        return task.skip(record.legs) if isinstance(task, TaskSequence) else task

    def _down(self, context: TaskContext) -> FlightTask:
        if context.blind and self._attitude is not None:
            return DescentTask(self._attitude, self._gravity_m_s2)
        return landing(Land())

    def _on_track(self, context: TaskContext) -> FlightTask:
        if self.first is not None:
            first, self.first = self.first, None
            planner = self._plan(first)
            for_law = None if self._instants.rows is None else Planner(first, self._references, self._preview)
            target = target_of(planner.horizon(context.now_us))
            start = Reference(target.motion[0, :4].copy(), target.heading[0, :2].copy())
            return TrackTask(planner, first.duration_s, 0, for_law, start=start)
        self._budget.spend(_TRACK_US)
        chosen = track(context.behaviour.track)
        return to_track(self._plan(chosen), chosen.duration_s)

    def _plan(self, chosen: Track) -> Planner:
        return Planner(chosen, self._references, self._instants.preview)


def climb(context: TaskContext) -> FlightTask:
    behaviour = context.behaviour
    return TakeoffTask(context.ground_m + behaviour.takeoff_height_m, None, context, behaviour.takeoff_speed_m_s)
