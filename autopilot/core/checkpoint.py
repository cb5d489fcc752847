"""The checkpoint of a flight: plain data to continue it after the autopilot was killed.

It belongs to the flight whose next frame follows it in time. Within `CLOSE_US`, references, the law's memory and the
estimator are restored; later only mode and task, from the present place.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, TypeAlias
from zlib import crc32

import msgspec

from colibri.autopilot.commander.mode_tasks import TaskRecord, task_record
from colibri.autopilot.commander.pilot import PilotRecord
from colibri.autopilot.commander.rules.failsafe_rule import FailsafeMemory
from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.control.loop import LoopRecord
from colibri.autopilot.control.profile import Profile
from colibri.autopilot.core.parts import Parts
from colibri.autopilot.guidance.mission.executor import MissionRecord
from colibri.autopilot.guidance.tasks.task import FlightTask, TaskContext
from colibri.common.earth.geodesy import Geodetic
from colibri.common.records import Record
from colibri.common.types import Array
from colibri.mavlink.hil.state import StateFrame
from colibri.mavlink.mission.items import MissionItem
from colibri.plant.vehicle.description import Vehicle

CLOSE_US = 50_000  # a control law goes on over so short a gap: rotors and attitude are as it left them
FOLLOWS_US = 30_000_000  # a frame that comes later is of another flight
Plans: TypeAlias = Mapping[int, Sequence[MissionItem]]  # by MAV_MISSION_TYPE


class Checkpoint(Record, frozen=True):
    """A flight at one control sample."""

    fingerprint: int  # hash of profile and vehicle: the memory of another law is not restored
    time_us: int
    origin: Geodetic  # origin of the ENU frame
    plan_ids: tuple[int, ...]  # opaque ids of mission, geofence and rally points, which are stored separately
    mission: MissionRecord
    pilot: PilotRecord
    task: TaskRecord
    loop: LoopRecord
    charge_ah: float  # taken from the battery
    energy_wh: float
    state_source: bytes  # state of the estimator; empty on state feedback
    rotor_lost: int | None  # index of a lost rotor
    rotor_speeds: Array  # modelled, parts of the largest, (4,)
    failsafes: FailsafeMemory
    had_station: bool  # whether a ground station was ever connected: the link-loss timer starts at the restart

    def is_followed_by(self, time_us: int, within_us: int = FOLLOWS_US) -> bool:
        return 0 <= time_us - self.time_us <= within_us


class History(NamedTuple):
    """A recorded flight, and the plans uploaded by ground stations."""

    checkpoint: Checkpoint
    plans: Plans


def fingerprint_of(profile: Profile, vehicle: Vehicle) -> int:
    return crc32(msgspec.msgpack.encode(profile) + repr(vehicle).encode())


Again: TypeAlias = Callable[[TaskRecord, Mode, TaskContext], FlightTask]


class Checkpointer:
    def __init__(self, fingerprint: int, parts: Parts) -> None:
        self._fingerprint = fingerprint
        self._parts = parts

    def record(self, time_us: int) -> Checkpoint:
        parts, pilot = self._parts, self._parts.pilot
        return Checkpoint(
            self._fingerprint,
            time_us,
            pilot.home.origin,
            parts.stations.plans.ids,
            parts.stations.missions.executor.record(),
            pilot.record(),
            task_record(pilot.task),
            parts.loop.record(),
            parts.battery.charge_ah,
            parts.battery.energy_wh,
            parts.state_source.record(),
            parts.rotor_loss.lost,
            parts.rotor_loss.watch.speeds,
            parts.supervisor.memory,
            parts.stations.heartbeat.station_us is not None,
        )

    def resume(self, history: History, frame: StateFrame, again: Again) -> None:
        """Restore every part but the state source, which comes before, at the first frame after a restart."""
        checkpoint, plans = history
        parts, stations, pilot = self._parts, self._parts.stations, self._parts.pilot
        seamless = checkpoint.fingerprint == self._fingerprint and checkpoint.is_followed_by(frame.time_us, CLOSE_US)
        parts.loop.resume(checkpoint.loop, seamless=seamless)
        parts.battery.resume(checkpoint.charge_ah, checkpoint.energy_wh)
        pilot.home.origin = checkpoint.origin
        stations.plans.restore(plans)
        same = stations.plans.ids == checkpoint.plan_ids
        stations.missions.resume(stations.plans.plans, checkpoint.mission if same else None)
        if checkpoint.had_station:
            stations.heartbeat.station_us = frame.time_us  # lost from now on
        state = parts.loop.observe(frame)
        pilot.resume(
            frame.time_us,
            state,
            checkpoint.pilot,
            lambda mode, context: again(checkpoint.task, mode, context),
            seamless=seamless,
        )
        stations.missions.moved_origin()
        if pilot.state.armed:
            parts.supervisor.memory = checkpoint.failsafes
        lost, ground = checkpoint.rotor_lost, pilot.ground
        if lost is not None:
            flying = pilot.state.armed and not ground.standing
            parts.rotor_loss.resume(lost, checkpoint.rotor_speeds, state, ground.height_m, flying=flying)
            pilot.readiness.lose_rotor(lost, parts.rotor_loss.remaining, lands=parts.rotor_loss.landing_for is not None)
