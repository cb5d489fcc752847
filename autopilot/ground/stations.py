"""The vehicle's side towards ground stations: all services, put together around one pilot, on one hub."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version as version_of_package
from math import pi

from colibri.autopilot.commander.commands import MAX_HEIGHT_M, Commands
from colibri.autopilot.commander.fence import Fence
from colibri.autopilot.commander.missions import Missions
from colibri.autopilot.commander.needs import ModeNeeds
from colibri.autopilot.commander.pilot import Pilot
from colibri.autopilot.commander.rules.modes import MODES, custom_mode, mode_of_custom
from colibri.autopilot.commander.status_queue import StatusQueue
from colibri.autopilot.ground.calibration import Calibration
from colibri.autopilot.ground.fault_injection import Failures
from colibri.autopilot.guidance.mission.geofence import FENCE_RULES
from colibri.autopilot.guidance.mission.items import MISSION_RULES, RALLY_RULES
from colibri.common.earth.geodesy import Geodetic, is_on_earth
from colibri.mavlink.files.flight_log import FlightLog
from colibri.mavlink.files.ftp import Ftp
from colibri.mavlink.files.log_download import Logs
from colibri.mavlink.files.memory import Memory
from colibri.mavlink.files.tree import Files, Tree
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.plant_status import PlantStatus
from colibri.mavlink.mission.items import FENCE, MISSION, RALLY
from colibri.mavlink.mission.service import MissionService, Vehicle
from colibri.mavlink.node.hub import Hub, Outgoing
from colibri.mavlink.node.service import to
from colibri.mavlink.parameters.metadata import Metadata
from colibri.mavlink.parameters.metadata_json import metadata_json
from colibri.mavlink.parameters.pack import packed_for
from colibri.mavlink.parameters.service import ParameterService
from colibri.mavlink.parameters.store import Parameters
from colibri.mavlink.services.command import (
    ACCEPTED,
    DENIED,
    Command,
    CommandService,
    Entry,
    Handler,
    Outcome,
    outcome_of,
)
from colibri.mavlink.services.identity import IDENTITIES, autopilot_version, banner, version_of
from colibri.mavlink.services.origin import OriginService, Setters
from colibri.mavlink.services.shell import Shell
from colibri.mavlink.services.standard_modes import ModeInfo, StandardModes
from colibri.mavlink.services.statustext import INFO, WARNING, StatusText
from colibri.mavlink.services.timesync import TimeService
from colibri.mavlink.setpoints.follow_target import Follow
from colibri.mavlink.setpoints.manual_control import Manual
from colibri.mavlink.setpoints.offboard import Offboard
from colibri.mavlink.streaming.heartbeat import HeartbeatService
from colibri.mavlink.streaming.rates import SDK, SILENT
from colibri.mavlink.streaming.service import StreamService
from colibri.mavlink.telemetry.encoder import Constants
from colibri.mavlink.telemetry.snapshot import Snapshot
from colibri.mavlink.telemetry.table import telemetry
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, mav
from colibri.mavlink.wire.framing import Framer
from colibri.mavlink.wire.refusal import Refusal
from colibri.mavlink.wire.signing import Signing

VERSION = version_of_package("colibri-sitl")
LOGS = "logs"
LOG_LINK = -1
"""The link on which the flight log is a listener like any other."""
REBOOT, SHUT_DOWN = 1.0, 2.0
PLAN_RULES = {MISSION: MISSION_RULES, FENCE: FENCE_RULES, RALLY: RALLY_RULES}
_COMMANDS = frozenset({"COMMAND_LONG", "COMMAND_INT"})


@dataclass(frozen=True, slots=True)
class StationSettings:
    """What a vehicle is towards ground stations.

    Attributes:
        system_id: MAVLink system id.
        identity: A name of `identity.IDENTITIES`.
        origin: Of the ENU frame.
        boot_unix_us: Unix time at the start; 0 where nobody knows it.
        signing: Judges and signs frames.
        files: What can be read and written by file transfer.
        logs: Where the logs of flights go; None: into folder `logs` of the files.
        feedback: What is flown by.
        relays_faults: Whether the plant is one that takes faults.
    """

    system_id: int
    identity: str
    origin: Geodetic
    boot_unix_us: int = 0
    signing: Signing | None = None
    files: Files | None = None
    logs: Files | None = None
    feedback: Feedback = Feedback.STATE
    relays_faults: bool = True


class Stations:
    """Serves any number of ground stations.

    It puts services together and decides nothing: most of its attributes are services.

    Attributes:
        hub: Where the links meet.
        offboard: The setpoints of companions.
        manual: The sticks of a pilot.
        follow: The target to follow.
        plans: The plans that were uploaded, and the protocol about them.
        missions: What flies them.
        fence: What holds the vehicle back.
        needs: Which needs of modes are met.
        commands: What obeys.
        failures: What is injected.
        log: Of each flight.
        restart: 1 once somebody has asked for a restart, 2 for the end; 0 before.
    """

    def __init__(
        self,
        settings: StationSettings,
        pilot: Pilot,
        missions: Missions,
        fence: Fence,
        lines: StatusQueue,
        parameters: Parameters,
        *,
        takes_attitude: bool,
    ) -> None:
        """Serve for `pilot` and the `missions` that it flies.

        Args:
            settings: Towards ground stations.
            pilot: Does what is commanded.
            missions: Take the plans.
            fence: Says which places are out of reach.
            lines: What these parts say.
            parameters: All numbers that can be changed.
            takes_attitude: Whether the control law takes attitude setpoints.
        """
        self._settings = settings
        self._lines = lines
        self._identity = IDENTITIES[settings.identity]
        self._pilot = pilot
        self._parameters = parameters
        self._text = StatusText()
        self._calibration = Calibration()
        self.failures = Failures(settings.feedback, relays=settings.relays_faults)
        self.restart = 0.0
        self.offboard, self.manual, self.follow = Offboard(), Manual(settings.system_id), Follow()
        self.missions, self.fence = missions, fence
        self.needs = ModeNeeds(pilot, missions, self.manual, self.offboard, self.follow, takes_attitude=takes_attitude)
        self.commands = Commands(pilot, fence, self.needs)
        vehicle = Vehicle(missions.load, missions.progress, missions.set_current, self.commands.guided_goto)
        self.plans = MissionService(PLAN_RULES, vehicle, self._text)
        self._heartbeat = HeartbeatService(self._identity)
        self._streams = StreamService(telemetry(Constants(boot_unix_us=settings.boot_unix_us)))
        modes = [ModeInfo(row.mode.title(), custom_mode(row.mode), row.standard, row.selectable) for row in MODES]
        self._modes = StandardModes(modes, self._select)
        files = self._files(settings.files or Memory())
        self.log = FlightLog(files, (LOGS,))
        self._framer = Framer()
        self._obeys = CommandService(self._handlers(), self._text)
        services = (
            self._heartbeat,
            self._obeys,
            self._streams,
            self._modes,
            TimeService(),
            ParameterService(parameters),
            self.plans,
            self.offboard,
            self.manual,
            self.follow,
            OriginService(
                Setters(self._set_origin, self.commands.move_home, self.commands.set_custom_mode), self._text
            ),
            Ftp(files),
            Logs(files, (LOGS,), lambda: self.log.name),
            Shell({"ver": lambda _: self.banner() + "\n", "status": lambda _: self._status(), "param": self._param}),
        )
        self.hub = Hub(
            settings.system_id, AUTOPILOT_COMPONENT, services, signing=settings.signing, observers=(self._streams,)
        )
        self._log_channel = self.hub.open(LOG_LINK, None)
        self._streams.use(self._log_channel, SILENT)
        self._logs_stream = False

    def banner(self) -> str:
        """Say who this is."""
        return banner(self._identity, VERSION)

    def use(self, channel: int, kind: str) -> None:
        """Stream to `channel` what its kind gets by default."""
        self._streams.use(channel, kind)

    @property
    def station_us(self) -> int | None:
        """When a ground station was heard last; None if there never was one."""
        return self._heartbeat.station_us

    def expect_station(self, now_us: int) -> None:
        """Take a ground station for heard now: one that was heard before a restart is to be heard again."""
        self._heartbeat.expect(now_us)

    def reboot(self) -> None:
        """Ask for a restart, as a ground station may."""
        self.restart = REBOOT

    def update(self, snapshot: Snapshot) -> None:
        """Take in the vehicle as it is now. Called once a control sample."""
        self._heartbeat.update(snapshot)
        self._streams.update(snapshot)
        origin = snapshot.origin
        self.offboard.update(snapshot.position_enu_m, self._pilot.context().state.euler[2], origin, snapshot.home)
        self.follow.update(origin)
        if snapshot.armed is not self._logs_stream:
            self._logs_stream = snapshot.armed
            self._streams.use(self._log_channel, SDK if snapshot.armed else SILENT)

    def hear_plant(self, plant_status: PlantStatus, now_us: int) -> None:
        """Take in what the plant says of faults that were asked for, and the time of the messages that follow."""
        self.needs.at(now_us)
        ended = self.failures.poll(plant_status.results, now_us)
        if ended is not None:
            command, outcome = ended
            self.hub.send(self._obeys.finish(command.id, command.peer, outcome))

    def poll(self, now_us: int) -> list[Outgoing]:
        """Do what is due; return what to send. Called once a frame."""
        for seq in self.missions.take_reached():
            self.plans.reached(seq)
        for severity, text in self._lines.take():
            self.say(severity, text)
        for text in self._calibration.poll(now_us):
            self.say(INFO, text)
        self.hub.poll(now_us)
        outbox = self.hub.take_outbox()
        self.log.update(self._pilot.state.armed, now_us)
        if not any(outgoing.link == LOG_LINK for outgoing in outbox):
            return outbox
        for outgoing in outbox:
            if outgoing.link == LOG_LINK:
                self.log.record(now_us, self._framer.take(outgoing.datagram))
        return [outgoing for outgoing in outbox if outgoing.link != LOG_LINK]

    def wait(self, reason: str) -> None:
        """Deny every command for a reason, and hear nothing else; without one, serve."""
        self.hub.accept_only(_COMMANDS if reason else None)
        self._obeys.close(reason)

    def take_outbox(self) -> list[Outgoing]:
        """Return what to send now, while nothing is known of the vehicle that could be told, or logged."""
        return [outgoing for outgoing in self.hub.take_outbox() if outgoing.link != LOG_LINK]

    def warn(self, text: str) -> None:
        """Tell everybody a warning."""
        self.say(WARNING, text)

    def say(self, severity: int, text: str) -> None:
        """Tell everybody a line."""
        self.hub.send(self._text.say(severity, text))

    def _files(self, root: Files) -> Files:
        metadata = Metadata(metadata_json(self._parameters))
        self._metadata = metadata
        pack = {"@PARAM/param.pck": lambda query: packed_for(self._parameters, query) or b""}
        mounts = {} if self._settings.logs is None else {LOGS: self._settings.logs}
        return Tree(root, mounts, {**metadata.files, **pack}, {"@MAV_LOG": LOGS})

    def _handlers(self) -> Mapping[int, Handler | Entry]:
        streams = self._streams
        streams.provide("AUTOPILOT_VERSION", lambda command: [to(command.peer, "AUTOPILOT_VERSION", *self._version())])
        streams.provide("AVAILABLE_MODES", self._modes.available_modes)
        streams.provide("AVAILABLE_MODES_MONITOR", self._modes.monitor)
        streams.provide("COMPONENT_METADATA", lambda command: self._metadata.provide(command.peer, command.now_us))
        streams.provide("MISSION_CURRENT", lambda command: [to(command.peer, "MISSION_CURRENT", *self.plans.current())])
        return {
            **self.commands.handlers(),
            **streams.handlers(),
            **self._modes.handlers(),
            mav.MAV_CMD_DO_SET_MISSION_CURRENT: self.plans.do_set_mission_current,
            mav.MAV_CMD_DO_SET_MODE: self._engaging(self.commands.handlers()[mav.MAV_CMD_DO_SET_MODE]),
            mav.MAV_CMD_PREFLIGHT_CALIBRATION: Entry(self._calibrate, frames=None, interruptible=True),
            mav.MAV_CMD_INJECT_FAILURE: lambda command: self.failures.inject(
                command, enabled=self._pilot.behaviour.inject_failures
            ),
            mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: self._restart,
            mav.MAV_CMD_PREFLIGHT_STORAGE: self._storage,
            mav.MAV_CMD_DO_SET_GLOBAL_ORIGIN: lambda command: outcome_of(
                self._set_origin(Geodetic(command.x, command.y, command.z))
            ),
        }

    def _engaging(self, handler: Handler) -> Handler:
        """Let whoever asks for a steered mode be the one who steers."""

        def obey(command: Command) -> Outcome:
            for service in (self.offboard, self.manual, self.follow):
                service.engage(command.peer, command.now_us)
            return handler(command)

        return obey

    def _calibrate(self, command: Command) -> Outcome:
        return self._calibration.begin(command, armed=self._pilot.state.armed)

    def _select(self, number: int, command: Command) -> Outcome:
        del command
        return outcome_of(self.commands.select(mode_of_custom(number)))

    def _version(self) -> Sequence[object]:
        return autopilot_version(self._identity, version_of(VERSION), self._settings.system_id)

    def _setters(self) -> Setters:
        return Setters(self._set_origin, self.commands.move_home, self.commands.set_custom_mode)

    def _set_origin(self, place: Geodetic) -> Refusal | None:
        if not is_on_earth(place.latitude_deg, place.longitude_deg) or not abs(place.altitude_m) <= MAX_HEIGHT_M:
            return Refusal("origin refused: not a latitude, longitude and altitude")
        if self._pilot.state.armed:
            return Refusal("origin refused: the rotors are armed")
        self._pilot.home.move_origin(place)
        self.missions.moved_origin()
        return None

    def _restart(self, command: Command) -> Outcome:
        if self._pilot.state.armed:
            return Outcome(DENIED, "restart refused: the rotors are armed")
        if command.p1 not in (REBOOT, SHUT_DOWN):
            return Outcome(DENIED, "restart with 1, shut down with 2")
        self.restart = command.p1
        return Outcome()

    def _storage(self, command: Command) -> Outcome:
        """Parameters are stored as they change; what is left to obey is the reset."""
        if command.p1 == 2.0:
            if self._pilot.state.armed:
                return Outcome(DENIED, "parameters refused: the rotors are armed")
            self._parameters.reset()
        return Outcome(ACCEPTED) if command.p1 in (0.0, 1.0, 2.0) else Outcome(DENIED, "storage: 0, 1 or 2")

    def _status(self) -> str:
        mode, armed = self._pilot.state
        x, y, z = self._pilot.context().state.position_enu_m
        reasons = "; ".join(self._pilot.readiness.refusals()) or "ready to arm"
        yaw_deg = (90.0 - self._pilot.context().state.euler[2] * 180.0 / pi) % 360.0
        return (
            f"{self.banner()}\nmode {mode}, {'armed' if armed else 'disarmed'}, {reasons}\n"
            f"east {x:.2f} north {y:.2f} up {z:.2f} m, heading {yaw_deg:.0f} degrees\n"
        )

    def _param(self, arguments: list[str]) -> str:
        shown = arguments[1:] if arguments[:1] == ["show"] else arguments
        names = [p.name for p in self._parameters if not shown or p.name.startswith(shown[0].upper().rstrip("*"))]
        return "".join(f"{name} {self._parameters[name]:g}\n" for name in names) or "no such parameter\n"
