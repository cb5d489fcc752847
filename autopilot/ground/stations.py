"""MAVLink services of a vehicle, on one hub."""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol, TypeVar, TypeVarTuple

from colibri.autopilot.commander.commands import Commanded, Commands
from colibri.autopilot.commander.fence import Fence
from colibri.autopilot.commander.home import Home
from colibri.autopilot.commander.missions import Missions
from colibri.autopilot.commander.mode_tasks import ModeTasks
from colibri.autopilot.commander.needs import ModeNeeds
from colibri.autopilot.commander.pilot import Pilot
from colibri.autopilot.commander.status_queue import StatusQueue
from colibri.autopilot.ground.conventions import PLACES, Conventions
from colibri.autopilot.ground.fault_injection import Failures
from colibri.autopilot.ground.onboard_log import LOGS, LoggedVehicle, OnboardLog
from colibri.autopilot.ground.system_commands import SystemCommands
from colibri.autopilot.guidance.mission.geofence import FENCE_RULES
from colibri.autopilot.guidance.mission.items import RALLY_RULES
from colibri.common.earth.geodesy import Geodetic, geodetic_of
from colibri.mavlink.files.ftp import Ftp
from colibri.mavlink.files.log_download import Logs
from colibri.mavlink.files.memory import MemoryFiles
from colibri.mavlink.files.tree import Files, Tree
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.plant_status import PlantStatus
from colibri.mavlink.mission.items import FENCE, MISSION, RALLY, MissionItem, StoredPlan
from colibri.mavlink.mission.service import MissionService, MissionVehicle
from colibri.mavlink.node.budget import Budget
from colibri.mavlink.node.hub import ChannelObserver, Hub, Outgoing
from colibri.mavlink.node.service import Service, to
from colibri.mavlink.parameters.metadata import Metadata, metadata_json
from colibri.mavlink.parameters.pack import packed
from colibri.mavlink.parameters.service import ParameterService
from colibri.mavlink.parameters.store import Parameters
from colibri.mavlink.services.command import CommandService, Handler
from colibri.mavlink.services.origin import OriginService, Setters
from colibri.mavlink.services.shell import Shell
from colibri.mavlink.services.standard_modes import ModeInfo, StandardModes
from colibri.mavlink.services.statustext import INFO, WARNING, Line, StatusText
from colibri.mavlink.services.timesync import TimeService
from colibri.mavlink.setpoints.follow_target import Follow
from colibri.mavlink.setpoints.manual_control import Manual
from colibri.mavlink.setpoints.offboard import LOCAL_FRAMES, Offboard
from colibri.mavlink.setpoints.radio import Radio
from colibri.mavlink.streaming.heartbeat import HeartbeatService
from colibri.mavlink.streaming.service import StreamService
from colibri.mavlink.telemetry.encoder import Encoder
from colibri.mavlink.telemetry.snapshot import HomePosition, TelemetrySnapshot
from colibri.mavlink.telemetry.table import telemetry
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, mav
from colibri.mavlink.wire.signing import Signing
from colibri.plant.vehicle.description import Vehicle

T = TypeVar("T")
Ts = TypeVarTuple("Ts")
MAX_SAID = 20  # status texts kept for the terminal
_COMMANDS = frozenset({"COMMAND_LONG", "COMMAND_INT"})


@dataclass(frozen=True, slots=True)
class StationSettings:
    """Settings of a vehicle towards ground stations."""

    system_id: int
    identity: str
    origin: Geodetic
    boot_unix_us: int = 0  # unix time at simulated time 0, µs; 0 if unknown
    signing: Signing | None = None
    files: Files | None = None
    logs: Files | None = None  # folder of flight logs; by default `logs` of the files
    feedback: Feedback = Feedback.STATE
    relays_faults: bool = True
    reports: bool = True  # whether samples are reported to ground stations and logged


def home_item(home: Home) -> MissionItem:
    """Return home as a waypoint above the sea."""
    place = geodetic_of(home.position_enu_m, home.origin)
    x, y = round(place.latitude_deg * 1e7), round(place.longitude_deg * 1e7)
    return MissionItem(mav.MAV_FRAME_GLOBAL, mav.MAV_CMD_NAV_WAYPOINT, 1, 0.0, 0.0, 0.0, 0.0, x, y, place.altitude_m)


def _at_home(encoder: Encoder, home: Home) -> Encoder:
    """Return an encoder by home and origin as they are, not as of the last frame."""
    return lambda s: encoder(s._replace(origin=home.origin, home=HomePosition(home.position_enu_m, home.yaw_rad)))


class Guarding(Protocol):
    """Catches the exceptions of named parts."""

    def guard(self, part: str, call: Callable[[*Ts], T], otherwise: Callable[[], T], *args: *Ts) -> T:
        """Return the result of `call`, or of `otherwise` on an exception."""

    def caught(self, part: str, error: Exception, instead: str = "") -> None: ...


class Stations:
    def __init__(
        self,
        settings: StationSettings,
        pilot: Pilot,
        missions: Missions,
        fence: Fence,
        lines: StatusQueue,
        parameters: Parameters,
        vehicle: Vehicle,
        tasks: ModeTasks,
        conventions: Conventions,
        *,
        takes_attitude: bool,
        defence: Guarding,
        budget: Budget,
    ) -> None:
        wire, streams, logs = conventions.wire, conventions.streams, conventions.logs
        self._conventions, self._lines, self.pilot, self._guard = conventions, lines, pilot, defence.guard
        self._text, self.reports = StatusText(), settings.reports
        self.banner = conventions.banner
        self._said: deque[Line] = deque(maxlen=MAX_SAID)
        self.failures = Failures(settings.feedback, relays=settings.relays_faults, motors=vehicle.rotors.count)
        self.offboard = Offboard(self._text, conventions.frames or LOCAL_FRAMES)
        self._follow = Follow(self._text)
        self.manual = Manual(settings.system_id, self._text)
        if conventions.radio:
            self.manual = Radio(settings.system_id, self._text, conventions.radio, parameters)
        self.missions, self.fence, self.parameters = missions, fence, parameters
        self.snapshot: TelemetrySnapshot | None = None
        self.needs = ModeNeeds(pilot, missions, self.manual, self.offboard, self._follow, takes_attitude=takes_attitude)
        self.system = SystemCommands(pilot, missions, parameters, identity=wire, system_id=settings.system_id)
        book = conventions.modes
        parts = Commanded(pilot, fence, missions, self.needs, tasks, parameters, book, conventions.banner)
        commands = conventions.commands(parts)
        self.modes, self.offboard.taken = commands.modes, commands.taken
        self.exempt, self.takeoff_by_stick = commands.exempt, commands.motion.takeoff_by_stick
        rules = {MISSION: conventions.mission_rules, FENCE: FENCE_RULES, RALLY: RALLY_RULES}
        executor, guided_goto = missions.executor, commands.motion.guided_goto
        on_mission = MissionVehicle(self._load, lambda: executor.progress, executor.set_current, guided_goto)
        if wire.home_first:
            missions.boot_unix_us = settings.boot_unix_us
            on_mission = on_mission._replace(home=lambda: home_item(pilot.home), describe=conventions.describe)
        self.plans = MissionService(
            rules, on_mission, self._text, streams=wire.streams_current, old_form=wire.old_form_first or None
        )
        self.heartbeat = HeartbeatService(wire)
        encoders = streams.chosen(telemetry(settings.boot_unix_us))
        if not wire.streams_current:
            encoders["MISSION_CURRENT"] = lambda _: self.plans.current()
            encoders |= {name: _at_home(encoders[name], pilot.home) for name in PLACES}
        self.streams = StreamService(encoders, streams)
        modes = StandardModes(
            [ModeInfo(each.name, each.number, each.standard, each.selectable) for each in book.modes if each.flies],
            lambda number, _: commands.modes.select(number),
        )
        metadata = Metadata(metadata_json(tuple(parameters)))
        files = _files(settings, metadata, parameters)
        self._provide(modes, metadata)
        self._obeys = CommandService(self._handlers(commands, modes), self._text)
        setters = Setters(self.system.set_origin, commands.move_home, commands.set_custom_mode)
        further = conventions.services(self)
        services: tuple[Service, ...] = (
            self.heartbeat,
            self._obeys,
            self.streams,
            TimeService(),
            ParameterService(parameters, self._text, as_floats=wire.numbers_as_floats),
            self.plans,
            self.offboard,
            self.manual,
            self._follow,
            OriginService(setters, self._text, acknowledges_mode=wire.acknowledges_mode),
            Ftp(files, budget),
            Logs(files, (LOGS,), lambda: self.log.name, budget, suffix=logs.names.suffix, first_id=logs.first_id),
            Shell(self.system.shell(), budget),
            *further,
        )
        self.hub = Hub(
            settings.system_id,
            AUTOPILOT_COMPONENT,
            services,
            signing=settings.signing,
            observers=(self.streams, *(each for each in further if isinstance(each, ChannelObserver))),
            caught=defence.caught,
            warn=lambda text: lines.say(WARNING, text),
            budget=budget,
        )
        self._logged: TelemetrySnapshot | None = None
        program = self.banner[0] if self.banner else ""
        logged = LoggedVehicle(vehicle.name, settings.system_id, parameters, program, settings.boot_unix_us)
        self.log = OnboardLog(logged, files, logs)

    def _load(self, plan_type: int, plan: StoredPlan) -> None:
        self.missions.load(plan_type, plan)
        self._conventions.loaded(self.parameters, plan_type, len(plan.items))

    def update(self, snapshot: TelemetrySnapshot) -> None:
        vehicle = self.pilot.sensed.vehicle
        assert vehicle is not None, "the vehicle has been seen"
        self.snapshot = snapshot
        self.heartbeat.update(snapshot)
        self.streams.update(snapshot)
        self.offboard.update(snapshot.position_enu_m, vehicle.euler[2], snapshot.origin, snapshot.home)
        self._follow.update(snapshot.origin)

    def go_on(self) -> None:
        """Send at least the mode if a snapshot fails."""
        self.modes.update()
        self.heartbeat.go_on(self.modes.shown.number, armed=self.pilot.state.armed)

    def receive_status(self, plant_status: PlantStatus, now_us: int) -> None:
        self.needs.at(now_us)
        ended = self.failures.poll(plant_status.results, now_us)
        if ended is not None:
            command, outcome = ended
            self.hub.send(self._obeys.finish(command.id, command.peer, outcome))

    def poll(self, now_us: int) -> list[Outgoing]:
        self._guard("progress", self._tell, _nothing, now_us)
        self._guard("hub", self._poll_hub, _nothing, now_us)
        said = self._text.take()
        self._said.extend(said)
        if said or self.snapshot is not self._logged:  # at control samples, not at each frame
            self._logged = self.snapshot
            armed = self.pilot.state.armed
            self._guard("flight log", lambda: self.log.update(self.snapshot, said, now_us, armed=armed), _nothing)
        return self.hub.take_outbox()

    def _poll_hub(self, now_us: int) -> None:
        for severity, text in self._lines.take():
            self.say(severity, text)
        self.hub.poll(now_us)

    def _tell(self, now_us: int) -> None:
        if self.missions.checking:
            self.missions.check_on()
        for seq in self.missions.take_reached():
            self.plans.reached(seq)
        for text in self.system.poll(now_us):
            self.say(INFO, text)

    def refuse_commands(self, reason: str) -> None:
        """Deny commands and drop other messages; an empty reason resumes service."""
        self.hub.accepts_only = _COMMANDS if reason else None
        self._obeys.closed = reason

    def introduce(self) -> None:
        """Send the texts of a start."""
        for text in (self.system.banner, *self._conventions.banner):
            self.say(INFO, text)

    def warn(self, text: str) -> None:
        self.say(WARNING, text)

    def say(self, severity: int, text: str) -> None:
        text = self._conventions.rewrite(text)
        if text:
            self.hub.send(self._text.say(severity, text))

    def take_texts(self) -> list[Line]:
        said = list(self._said)
        self._said.clear()
        return said

    def _provide(self, modes: StandardModes, metadata: Metadata) -> None:
        provide, version = self.streams.provide, self.system.version
        provide("AUTOPILOT_VERSION", lambda command: [to(command.peer, "AUTOPILOT_VERSION", *version)])
        provide("AVAILABLE_MODES", modes.available_modes)
        provide("AVAILABLE_MODES_MONITOR", modes.monitor)
        provide("COMPONENT_METADATA", lambda command: metadata.provide(command.peer, command.now_us))
        provide("MISSION_CURRENT", lambda command: [to(command.peer, "MISSION_CURRENT", *self.plans.current())])

    def _handlers(self, commands: Commands, modes: StandardModes) -> Mapping[int, Handler]:
        return {
            **self.streams.handlers(),
            **modes.handlers(),
            **self.system.handlers(),
            mav.MAV_CMD_DO_SET_MISSION_CURRENT: self.plans.do_set_mission_current,
            mav.MAV_CMD_INJECT_FAILURE: lambda command: self.failures.inject(
                command, enabled=self.pilot.behaviour.inject_failures
            ),
            **commands.handlers(),
        }


def _files(settings: StationSettings, metadata: Metadata, parameters: Parameters) -> Files:
    pack = {"@PARAM/param.pck": lambda query: packed(parameters, query) or b""}
    mounts = {} if settings.logs is None else {LOGS: settings.logs}
    return Tree(settings.files or MemoryFiles(), mounts, {**metadata.files, **pack}, {"@MAV_LOG": LOGS})


def _nothing() -> None: ...
