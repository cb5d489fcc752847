"""What a flight needs to go on after the autopilot was killed, as plain data.

A record is made at each control sample; whoever keeps it hands it to the vehicle of the next process. The first frame
says whether it is of the same flight: its time follows the record's. Close behind it everything goes on, with the
references, the control law's memory and the estimator as they were. Later, what is asked for goes on, from where the
vehicle is. What the services of ground stations remember of a conversation is not kept.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, TypeAlias
from zlib import crc32

import msgspec

from colibri.autopilot.commander.pilot import Pilot, PilotRecord
from colibri.autopilot.commander.rules.failsafe_rule import Memory
from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.commander.supervisor import Supervisor
from colibri.autopilot.commander.task_record import CourseRecord, course_record
from colibri.autopilot.control.loop import ControlLoop, LoopRecord
from colibri.autopilot.control.profile import Profile
from colibri.autopilot.control.rotor_loss.rotor_loss import RotorLoss
from colibri.autopilot.estimation.state_source import Senses
from colibri.autopilot.ground.battery_monitor import PowerMeter
from colibri.autopilot.ground.stations import Stations
from colibri.autopilot.guidance.mission.executor import MissionRecord
from colibri.autopilot.guidance.tasks.task import Course, Scene
from colibri.common.earth.geodesy import Geodetic
from colibri.common.types import Array
from colibri.mavlink.hil.state import StateFrame
from colibri.mavlink.mission.items import MissionItem
from colibri.plant.vehicle.description import Vehicle

CLOSE_US = 50_000
"""A control law goes on over a gap as short as this: rotors and attitude are as it left them."""
FOLLOWS_US = 30_000_000
"""What comes later is of another flight."""

Plans: TypeAlias = Mapping[int, Sequence[MissionItem]]
"""Items by MAV_MISSION_TYPE."""


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


def goes_on(mode: Mode, seq: int) -> str:
    """Say what goes on."""
    what = f"mission goes on at item {seq}" if mode is Mode.MISSION else f"{mode} goes on"
    return f"restarted in flight: {what}"


Again: TypeAlias = Callable[[CourseRecord, Mode, Scene], Course]
"""Says how a mode goes on."""


class Keeper:
    """Keeps one vehicle's flight."""

    def __init__(
        self,
        maker: int,
        loop: ControlLoop,
        senses: Senses,
        pilot: Pilot,
        stations: Stations,
        power: PowerMeter,
        rotor_loss: RotorLoss,
        supervisor: Supervisor,
    ) -> None:
        """Keep what these parts of a vehicle know; `maker` is `maker_of` it."""
        self._maker = maker
        self._loop, self._senses = loop, senses
        self._pilot, self._stations = pilot, stations
        self._power, self._rotor_loss, self._supervisor = power, rotor_loss, supervisor

    def record(self, time_us: int) -> Kept:
        """Return the flight as it is now."""
        return Kept(
            self._maker,
            time_us,
            self._pilot.home.origin,
            self._stations.plans.ids,
            self._stations.missions.record(),
            self._pilot.record(),
            course_record(self._pilot.course),
            self._loop.record(),
            self._power.charge_ah,
            self._power.energy_wh,
            self._senses.record(),
            self._rotor_loss.lost,
            self._rotor_loss.watch.speeds,
            self._supervisor.memory,
            self._stations.station_us is not None,
        )

    def resume(self, past: Past, frame: StateFrame, again: Again) -> None:
        """Have every part but the senses, who come before, go on with a flight at its next frame."""
        kept, plans = past
        stations, pilot = self._stations, self._pilot
        closely = kept.is_close_to(frame.time_us) and kept.maker == self._maker
        self._loop.resume(kept.loop, closely=closely)
        self._power.resume(kept.charge_ah, kept.energy_wh)
        pilot.home.move_origin(kept.origin)
        stations.plans.restore(plans)
        same = stations.plans.ids == kept.plan_ids
        stations.missions.resume(stations.plans.plans, kept.mission if same else None)
        if kept.had_station:
            stations.expect_station(frame.time_us)
        state = self._loop.state(frame)
        pilot.resume(
            frame.time_us, state, kept.pilot, lambda mode, scene: again(kept.course, mode, scene), closely=closely
        )
        stations.missions.moved_origin()
        if pilot.state.armed:
            self._supervisor.resume(kept.failsafes)
        if kept.rotor_lost is not None:
            flying = pilot.state.armed and not pilot.standing
            self._rotor_loss.resume(kept.rotor_lost, kept.rotor_speeds, state, pilot.ground_m, flying=flying)
            pilot.lose_rotor(kept.rotor_lost)
