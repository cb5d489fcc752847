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
from colibri.autopilot.commander.task_record import TaskRecord, task_record
from colibri.autopilot.control.loop import ControlLoop, LoopRecord
from colibri.autopilot.control.profile import Profile
from colibri.autopilot.control.rotor_loss.rotor_loss import RotorLoss
from colibri.autopilot.estimation.state_source import StateSource
from colibri.autopilot.ground.battery_monitor import BatteryMonitor
from colibri.autopilot.ground.stations import Stations
from colibri.autopilot.guidance.mission.executor import MissionRecord
from colibri.autopilot.guidance.tasks.task import FlightTask, TaskContext
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


class Checkpoint(NamedTuple):
    """A flight at one control sample.

    Attributes:
        fingerprint: Of profile and vehicle: what another law remembers is of no use.
        time_us: Simulated time.
        origin: Of the ENU frame.
        plan_ids: Opaque ids of mission, geofence and rally points, which are kept by themselves.
        mission: Where the mission stands.
        pilot: Mode, home, references.
        task: What is flown.
        loop: The control law.
        charge_ah: Taken from the battery.
        energy_wh: The same as energy.
        state_source: Of the estimator; empty where the state is told.
        rotor_lost: 0..3; None while all turn.
        rotor_speeds: As their lag has them, parts of the largest, (4,).
        failsafes: What they remember.
        had_station: Whether a ground station was ever heard: its loss counts from the restart.
    """

    fingerprint: int
    time_us: int
    origin: Geodetic
    plan_ids: tuple[int, ...]
    mission: MissionRecord
    pilot: PilotRecord
    task: TaskRecord
    loop: LoopRecord
    charge_ah: float
    energy_wh: float
    state_source: bytes
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


class History(NamedTuple):
    """What was kept of a flight.

    Attributes:
        checkpoint: Its last control sample.
        plans: Uploaded by ground stations.
    """

    checkpoint: Checkpoint
    plans: Plans


def fingerprint_of(profile: Profile, vehicle: Vehicle) -> int:
    """Return a number that differs between profiles and vehicles that do."""
    return crc32(msgspec.msgpack.encode(profile) + repr(vehicle).encode())


def goes_on(mode: Mode, seq: int) -> str:
    """Say what goes on."""
    what = f"mission goes on at item {seq}" if mode is Mode.MISSION else f"{mode} goes on"
    return f"restarted in flight: {what}"


Again: TypeAlias = Callable[[TaskRecord, Mode, TaskContext], FlightTask]
"""Says how a mode goes on."""


class Checkpointer:
    """Keeps one vehicle's flight."""

    def __init__(
        self,
        fingerprint: int,
        loop: ControlLoop,
        state_source: StateSource,
        pilot: Pilot,
        stations: Stations,
        power: BatteryMonitor,
        rotor_loss: RotorLoss,
        supervisor: Supervisor,
    ) -> None:
        """Keep what these parts of a vehicle know; `fingerprint` is `fingerprint_of` it."""
        self._fingerprint = fingerprint
        self._loop, self._state_source = loop, state_source
        self._pilot, self._stations = pilot, stations
        self._power, self._rotor_loss, self._supervisor = power, rotor_loss, supervisor

    def record(self, time_us: int) -> Checkpoint:
        """Return the flight as it is now."""
        return Checkpoint(
            self._fingerprint,
            time_us,
            self._pilot.home.origin,
            self._stations.plans.ids,
            self._stations.missions.record(),
            self._pilot.record(),
            task_record(self._pilot.task),
            self._loop.record(),
            self._power.charge_ah,
            self._power.energy_wh,
            self._state_source.record(),
            self._rotor_loss.lost,
            self._rotor_loss.watch.speeds,
            self._supervisor.memory,
            self._stations.station_us is not None,
        )

    def resume(self, history: History, frame: StateFrame, again: Again) -> None:
        """Have every part but the senses, who come before, go on with a flight at its next frame."""
        checkpoint, plans = history
        stations, pilot = self._stations, self._pilot
        seamless = checkpoint.is_close_to(frame.time_us) and checkpoint.fingerprint == self._fingerprint
        self._loop.resume(checkpoint.loop, seamless=seamless)
        self._power.resume(checkpoint.charge_ah, checkpoint.energy_wh)
        pilot.home.move_origin(checkpoint.origin)
        stations.plans.restore(plans)
        same = stations.plans.ids == checkpoint.plan_ids
        stations.missions.resume(stations.plans.plans, checkpoint.mission if same else None)
        if checkpoint.had_station:
            stations.expect_station(frame.time_us)
        state = self._loop.state(frame)
        pilot.resume(
            frame.time_us,
            state,
            checkpoint.pilot,
            lambda mode, context: again(checkpoint.task, mode, context),
            seamless=seamless,
        )
        stations.missions.moved_origin()
        if pilot.state.armed:
            self._supervisor.resume(checkpoint.failsafes)
        if checkpoint.rotor_lost is not None:
            flying = pilot.state.armed and not pilot.standing
            self._rotor_loss.resume(
                checkpoint.rotor_lost, checkpoint.rotor_speeds, state, pilot.ground_m, flying=flying
            )
            pilot.lose_rotor(checkpoint.rotor_lost)
