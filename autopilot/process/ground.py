"""Ground stations of the process: links, files, terminal reports."""

from collections import deque
from collections.abc import Iterable, Iterator
from math import hypot
from time import perf_counter, thread_time, time
from typing import TYPE_CHECKING, Any

from colibri.autopilot.control.profile import Profile
from colibri.autopilot.core.autopilot import Autopilot
from colibri.autopilot.core.checkpoint import History
from colibri.autopilot.core.copter import Copter, copter_autopilot
from colibri.autopilot.core.defence import table
from colibri.autopilot.core.step import Received
from colibri.autopilot.ground.stations import MAX_SAID, StationSettings
from colibri.autopilot.ground.system_commands import REBOOT, SHUT_DOWN
from colibri.autopilot.guidance.trajectories.loading import load_track
from colibri.autopilot.identities import conventions_of
from colibri.autopilot.parameters.definitions import ImpossibleError
from colibri.autopilot.process.error_log import ErrorLog
from colibri.autopilot.process.ground_links import GroundLinks, open_links
from colibri.autopilot.process.state_folder import GroundError, StateFolder
from colibri.autopilot.process.station_events import LINK, EventStation
from colibri.autopilot.process.station_traffic import StationTraffic
from colibri.autopilot.process.stepped_links import Conductor, SteppedLinks
from colibri.autopilot.spec import AutopilotSpec
from colibri.common.process.log_files import LogError
from colibri.common.process.status import Status
from colibri.common.serialization import to_bytes
from colibri.mavlink.links.link import LinkError
from colibri.mavlink.telemetry.snapshot import TelemetrySnapshot
from colibri.mavlink.wire.signing import tick_at
from colibri.plant.vehicle.description import Vehicle

if TYPE_CHECKING:
    from colibri.autopilot.process.logs import AutopilotLog

_REPORT_EVERY_S = 0.5
_SAVE_EVERY_S = 10.0
_STANDING_SAMPLES = 50  # control samples between saves while disarmed


class GroundService:
    """Serves ground stations; a restart replaces `autopilot`."""

    def __init__(
        self,
        spec: AutopilotSpec,
        profile: Profile,
        vehicle: Vehicle,
        status: Status,
        conductor: Conductor | None = None,
    ) -> None:
        self._spec = spec
        self._profile = profile
        self._vehicle = vehicle
        self._status = status
        self._state = StateFolder(spec, profile, vehicle, lambda: tick_at(time()))
        for warning in self._state.warnings:
            status.say("said", f"warning: {warning}")
        self._boot_unix_us = spec.boot_unix_us
        if not (spec.boot_unix_us or spec.stepped):  # what is stepped is the same at every hour
            self._boot_unix_us = round(time() * 1e6)
        self._first = None
        if spec.track:
            self._first, note = load_track(spec.track, vehicle, profile, spec.floor)
            if note:
                status.say("track", note)
        self.errors = ErrorLog(spec.out or spec.state, status)
        self._log: AutopilotLog | None = None
        self._traffic = StationTraffic(spec.out, spec.boot_unix_us) if spec.out and spec.tlog else None
        self._recorded_snapshot: TelemetrySnapshot | None = None
        self._texts: deque[str] = deque(maxlen=MAX_SAID)
        self.autopilot = self._new_autopilot(self._state.history())
        self._kept_samples = self._kept_plans = 0
        self._kept_armed = False
        try:
            links = open_links(spec.gcs, signed=self._state.signing.active, insecure=spec.insecure)
        except LinkError as error:
            raise GroundError(str(error)) from error
        self._links: GroundLinks | SteppedLinks = GroundLinks(links, perf_counter, thread_time)
        if conductor is not None:
            self._links = SteppedLinks(conductor, lambda: self.copter.pilot.state)
        self._events = EventStation(spec.events, spec.system_id, self._state.signing) if spec.events else None
        if self._events:
            self._events.introduce(self.copter.stations)
        self.shut_down = self._full_reported = False
        self._revision = self.copter.parameters.revision
        self._reported_s = self._saved_s = perf_counter()
        self._reported_us = 0
        self._sources: set[tuple[str, str]] = set()
        for number, link in enumerate(links):
            scheme, _, rest = link.url.partition(":")
            calls = scheme in ("udpout", "tcp", "serial")
            does = "connects to ground stations at" if calls else "waits for ground stations on"
            self._status.say("ground", f"{does} {rest} ({scheme})", url=link.url, link=number)

    def record(self, log: "AutopilotLog") -> None:
        self._log = log
        log.begin_again(self._values, self._past_bytes)
        log.follow(self.copter.parameters)

    @property
    def copter(self) -> Copter:
        return self.autopilot.stages

    def serve(self, now_s: float) -> Autopilot[Copter]:
        """Answer ground stations last, when acknowledged changes are on disk."""
        stations = self.copter.stations
        received: Iterable[Received] = self._links.receive(stations)
        if self._events:
            received = [*self._events.due(self.copter.time_us), *received]
        passed: list[bytes] = []
        if self._traffic and received:
            received = _noting(received, passed)
        if self._log and received:
            received = self._recorded(self._log, received)
        outbox = self.autopilot.serve(received)
        if self._events:
            outbox = [outgoing for outgoing in outbox if outgoing.link != LINK]
        self._record_told()
        if stations.system.restart:
            self._restart(stations.system.restart)
        self.copter.guard(table.PROCESS, self._look_after, lambda: None, now_s)
        self._links.send(outbox)
        if self._traffic:
            self._log_traffic(self._traffic, [*passed, *(outgoing.datagram for outgoing in outbox)])
        records = self.copter.defence.take()
        if records:
            self.errors.write(records)
        return self.autopilot

    def _log_traffic(self, traffic: StationTraffic, datagrams: list[bytes]) -> None:
        try:
            if datagrams:
                traffic.write(self.copter.time_us or self.copter.waiting_us or 0, datagrams)
        except LogError as error:
            self._status.say("said", f"{error}; flying on")

    def _record_told(self) -> None:
        stations = self.copter.stations
        snapshot, said = stations.snapshot, stations.take_texts()
        if said:
            self._texts.extend(map(str, said))
        if self._log is None:
            return
        try:
            for line in said:
                self._log.say(self.copter.pilot.context().now_us, *line)
            if snapshot is not None and snapshot is not self._recorded_snapshot:
                self._recorded_snapshot = snapshot
                self._log.write_snapshot(snapshot)
        except LogError as error:
            self._status.say("said", f"{error}; flying on")

    def _recorded(self, log: "AutopilotLog", received: Iterable[Received]) -> Iterator[Received]:
        try:
            yield from log.recorded(received)
        except LogError as error:
            self._status.say("said", f"{error}; flying on")

    def _look_after(self, now_s: float) -> None:
        if now_s >= self._reported_s + _REPORT_EVERY_S and self.copter.pilot.sensed.vehicle is not None:
            self._report(now_s)
        if self.copter.parameters.revision != self._revision:
            self._revision = self.copter.parameters.revision
            self._state.save_parameters(self.copter.parameters)
        if self._state.keeps_flights:
            self._keep()

    def _keep(self) -> None:
        copter, samples = self.copter, self.copter.samples
        if samples == self._kept_samples:  # between two control samples
            return
        changes, armed = copter.stations.missions.changes, copter.pilot.state.armed
        changed = armed is not self._kept_armed or changes != self._kept_plans
        if not (armed or changed) and samples - self._kept_samples < _STANDING_SAMPLES:
            return
        if changes != self._kept_plans:
            plans = copter.stations.plans.plans
            self._state.save_plans({plan_type: plan.items for plan_type, plan in plans.items()})
        record = copter.record()
        if record is not None and not self._state.keep(record) and not self._full_reported:
            self._full_reported = True
            self._status.say("said", "the flight record is too large: after a restart it would begin in hold")
        self._kept_samples, self._kept_plans, self._kept_armed = samples, changes, armed

    def close(self) -> None:
        self._report_texts()
        self.copter.stations.log.close()
        self._state.save_signing()
        self._links.close()
        if self._traffic:
            self._traffic.close()
        self._state.close()

    def abandon(self) -> None:
        """Close without writing, like a power cut."""
        self._state.close()

    def _restart(self, kind: float) -> None:
        if kind == SHUT_DOWN:
            self.shut_down = True
            self._status.say("said", "shut down by a ground station")
        elif kind == REBOOT:
            try:
                autopilot = self._new_autopilot(None)
            except Exception as error:
                self.copter.stations.system.restart = 0.0
                self.copter.defence.caught(table.RESTART, error, "the autopilot continues without restart")
                return
            self.copter.stations.log.close()
            self.errors.write(self.copter.defence.take())
            self.autopilot = autopilot
            self._kept_samples = self._kept_plans = 0
            self._links.introduce(self.copter.stations)
            if self._events:
                self._events.introduce(self.copter.stations)
            if self._log:
                self._log.begin_again(self._values, self._past_bytes)
            self._revision = self.copter.parameters.revision
            self._status.say("said", "restarted by a ground station")

    def _new_autopilot(self, history: History | None) -> Autopilot[Copter]:
        spec = self._spec
        conventions = conventions_of(spec.identity)
        self._values = conventions.booted(self._state.parameters())
        self._past_bytes = b"" if history is None else to_bytes(history)
        settings = StationSettings(
            system_id=spec.system_id,
            identity=spec.identity,
            origin=spec.home.origin,
            boot_unix_us=self._boot_unix_us,
            signing=self._state.signing,
            files=self._state.files,
            logs=self._state.logs,
            feedback=spec.feedback,
            relays_faults=spec.simulator is None,
        )
        try:
            autopilot = copter_autopilot(
                self._profile,
                self._vehicle,
                settings,
                perf_counter,
                values=self._values,
                first=self._first,
                history=history,
                strict=spec.strict,
            )
        except ImpossibleError as error:
            raise GroundError(f"{self._state.parameter_path()}: {error}") from error
        parts = autopilot.stages.parts
        kept = conventions.kept_plans(parts.parameters)
        if kept:
            self._state.save_parameters(parts.parameters)
            for plan_type, items in self._state.plans().items():
                if plan_type in kept and items:
                    parts.stations.plans.load(plan_type, items)
        return autopilot

    def _report(self, now_s: float) -> None:
        pilot = self.copter.pilot
        self._report_texts()
        facts = self._links.facts(self.copter.stations, now_s - self._reported_s)
        if self._status.as_json:
            self._status.say("status", "", **self._facts(now_s), links=facts)
        self._reported_s, self._reported_us = now_s, pilot.context().now_us
        heard = {(link["url"], who) for link in facts for who in link["heard"]}
        for url, who in sorted(heard - self._sources):
            self._status.say("heard", f"receiving from system {who} on {url}")
        for url, who in sorted(self._sources - heard):
            self._status.say("heard", f"system {who} is silent on {url}")
        self._sources = heard
        if self._state.signing.key_changed or now_s >= self._saved_s + _SAVE_EVERY_S:
            self._saved_s = now_s
            self._state.save_signing()

    def _report_texts(self) -> None:
        for text in (*self._texts, *self._links.take_notes()):
            self._status.say("said", text)
        self._texts.clear()

    def _facts(self, now_s: float) -> dict[str, Any]:
        pilot = self.copter.pilot
        now_us, state = pilot.context().now_us, pilot.context().state
        return {
            "mode": pilot.state.mode,
            "armed": pilot.state.armed,
            "position_enu_m": state.position_enu_m,
            "speed_m_s": hypot(*state.velocity_enu_m_s),
            "sim_time_s": now_us * 1e-6,
            "times_real_time": (now_us - self._reported_us) * 1e-6 / (now_s - self._reported_s),
            "solve_time_us": self.copter.parts.actuation.solve_time_s * 1e6,
        }


def _noting(received: Iterable[Received], datagrams: list[bytes]) -> Iterator[Received]:
    for each in received:
        datagrams.append(each.datagram)
        yield each
