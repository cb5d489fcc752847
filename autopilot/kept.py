"""What a flight needs to go on after the autopilot was killed, as plain data.

A record is made at each control sample; whoever keeps it hands it to the vehicle of the next process. The first frame
says whether it is of the same flight: its time follows the record's. Close behind it everything goes on, with the
references, the control law's memory and the estimator as they were. Later, what is asked for goes on, from where the
vehicle is. What the services of ground stations remember of a conversation is not kept.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias
from zlib import crc32

import msgspec

from autopilot.circling import Round
from autopilot.controller import Array
from autopilot.course import Course
from autopilot.courses import Along, Climb, Legs, Stop, Way
from autopilot.failsafes import Memory
from autopilot.loop import LoopRecord
from autopilot.mission import MissionRecord
from autopilot.missions import MissionCourse
from autopilot.modes import Mode
from autopilot.orders import OrderRecord, record_of
from autopilot.pilot import PilotRecord
from autopilot.profile import Profile
from mavlink.geodesy import Geodetic
from mavlink.services.mission_items import MissionItem
from plant.vehicle import Vehicle

CLOSE_US = 50_000
"""A control law goes on over a gap as short as this: rotors and attitude are as it left them."""
FOLLOWS_US = 30_000_000
"""What comes later is of another flight."""

Plans: TypeAlias = Mapping[int, Sequence[MissionItem]]
"""Items by MAV_MISSION_TYPE."""


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


class Kept(NamedTuple):
    """A flight at one control sample.

    Attributes:
        maker: Of profile and vehicle: what another law remembers is of no use.
        time_us: Simulated time.
        origin: Of the ENU frame.
        plan_ids: Opaque ids of mission, geofence and rally points, which are kept by themselves.
        mission: Where the mission stands.
        pilot: Mode, home, references.
        course: What is flown.
        loop: The control law.
        charge_ah: Taken from the battery.
        energy_wh: The same as energy.
        senses: Of the estimator; empty where the state is told.
        rotor_lost: 0..3; None while all turn.
        rotor_speeds: As their lag has them, parts of the largest, (4,).
        failsafes: What they remember.
        had_station: Whether a ground station was ever heard: its loss counts from the restart.
    """

    maker: int
    time_us: int
    origin: Geodetic
    plan_ids: tuple[int, ...]
    mission: MissionRecord
    pilot: PilotRecord
    course: CourseRecord
    loop: LoopRecord
    charge_ah: float
    energy_wh: float
    senses: bytes
    rotor_lost: int | None
    rotor_speeds: Array
    failsafes: Memory
    had_station: bool

    def is_followed_by(self, time_us: int) -> bool:
        """Whether a frame can be of the same flight."""
        return 0 <= time_us - self.time_us <= FOLLOWS_US

    def is_close_to(self, time_us: int) -> bool:
        """Whether all goes on at a frame as if nothing had happened."""
        return 0 <= time_us - self.time_us <= CLOSE_US


class Past(NamedTuple):
    """What was kept of a flight.

    Attributes:
        kept: Its last control sample.
        plans: Uploaded by ground stations.
    """

    kept: Kept
    plans: Plans


def maker_of(profile: Profile, vehicle: Vehicle) -> int:
    """Return a number that differs between profiles and vehicles that do."""
    return crc32(msgspec.msgpack.encode(profile) + repr(vehicle).encode())


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


def goes_on(mode: Mode, seq: int) -> str:
    """Say what goes on."""
    what = f"mission goes on at item {seq}" if mode is Mode.MISSION else f"{mode} goes on"
    return f"restarted in flight: {what}"
