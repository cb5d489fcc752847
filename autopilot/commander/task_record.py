"""A flight task as plain data, for the checkpoint."""

from typing import NamedTuple

from colibri.autopilot.commander.missions import MissionCourse
from colibri.autopilot.guidance.tasks.orbit import Round
from colibri.autopilot.guidance.tasks.orders import OrderRecord, record_of
from colibri.autopilot.guidance.tasks.position import Along, Climb, Legs, Stop, Way
from colibri.autopilot.guidance.tasks.task import Course


class CourseRecord(NamedTuple):
    """What is flown where the mode does not say it.

    Attributes:
        order: By which a course can begin again; None where that is the mode's own.
        began_us: When the track that is flown began; None where none is.
        turns: How often the mission's circle was flown around.
        legs: How many legs are left of what is flown in legs.
    """

    order: OrderRecord | None = None
    began_us: int | None = None
    turns: float = 0.0
    legs: tuple[int, ...] = ()


def course_record(course: Course) -> CourseRecord:
    """Return what is flown."""
    if isinstance(course, MissionCourse):
        return CourseRecord(turns=course.turns, legs=course.legs)
    if isinstance(course, Legs):
        return course_record(course.course) if isinstance(course.course, Along) else CourseRecord(legs=course.left)
    if isinstance(course, Along):
        return CourseRecord(began_us=course.began_us)
    if isinstance(course, Way | Round | Climb | Stop):
        return CourseRecord(record_of(course.order))
    return CourseRecord()
