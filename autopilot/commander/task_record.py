"""A flight task as plain data, for the checkpoint."""

from typing import NamedTuple

from colibri.autopilot.commander.missions import MissionTask
from colibri.autopilot.guidance.tasks.orbit import OrbitTask
from colibri.autopilot.guidance.tasks.orders import OrderRecord, record_of
from colibri.autopilot.guidance.tasks.position import GoToTask, HoldTask, TakeoffTask, TaskSequence, TrackTask
from colibri.autopilot.guidance.tasks.task import FlightTask


class TaskRecord(NamedTuple):
    """State of a flight task.

    Attributes:
        order: With which the task begins again; None if the mode alone determines it.
        began_us: When the track that is flown began; None where none is.
        turns: How often the mission's circle was flown around.
        legs: How many legs are left of what is flown in legs.
    """

    order: OrderRecord | None = None
    began_us: int | None = None
    turns: float = 0.0
    legs: tuple[int, ...] = ()


def task_record(task: FlightTask) -> TaskRecord:
    """Return the state of a task."""
    if isinstance(task, MissionTask):
        return TaskRecord(turns=task.turns, legs=task.legs)
    if isinstance(task, TaskSequence):
        return task_record(task.task) if isinstance(task.task, TrackTask) else TaskRecord(legs=task.left)
    if isinstance(task, TrackTask):
        return TaskRecord(began_us=task.began_us)
    if isinstance(task, GoToTask | OrbitTask | TakeoffTask | HoldTask):
        return TaskRecord(record_of(task.order))
    return TaskRecord()
