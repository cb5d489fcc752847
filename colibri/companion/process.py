"""Process of a companion: its link and clock, and its report."""

import csv
import signal
from argparse import Namespace
from collections.abc import Iterator
from dataclasses import replace
from math import degrees, isfinite
from pathlib import Path
from time import perf_counter, time
from typing import Any, NamedTuple, TextIO

from colibri.analysis.recording import SETTLED_AFTER_S
from colibri.analysis.report import length, write_report
from colibri.autopilot.control.interface import Fallback
from colibri.autopilot.control.profile import Profile, load_profile
from colibri.autopilot.guidance.trajectories.loading import load_track, track_through
from colibri.autopilot.guidance.trajectories.tracks import Track
from colibri.common.errors import Error
from colibri.common.files import regular
from colibri.common.process.lifecycle import EXIT_FAILED, Stop, fail, gc_frozen, handle_endings, one_line
from colibri.common.process.status import Silent, Status
from colibri.common.types import Address
from colibri.companion.guide import Companion
from colibri.companion.plan_file import SUFFIX, MissionPlan, read_plan
from colibri.companion.setpoints import FlightSummary, LogRow
from colibri.companion.settings import CompanionSettings, SetpointKind
from colibri.companion.stack import STACKS, CompanionError, read_response
from colibri.companion.steering.references import stay_of
from colibri.companion.supervision.phases import CompanionPhase
from colibri.companion.supervision.rules import FlightLimits
from colibri.companion.vehicle_peer import LocalOrigin, VehiclePeer
from colibri.flights.folder import occupied
from colibri.mavlink.links.link import GroundLink, LinkError
from colibri.mavlink.links.open import check_reach, open_ground_link
from colibri.mavlink.wire.signing import Signing, SigningError, read_key, tick_at
from colibri.plant.vehicle.description import Vehicle, load_vehicle

LOG, REPORT, RESPONSE, FIGURE = "companion.csv", "report.json", "companion.toml", "identification.png"
_POLL_S = 0.002
_IDENTIFIES_AT_M = 3.0
_SAY_FAILING_EVERY_S = 5.0
_MAX_IGNORED = 5  # of more strangers nothing is said
_SILENT_S = 3.0  # silence after which the vehicle may have another address


class CompanionFlight(NamedTuple):
    settings: CompanionSettings
    profile: Profile
    vehicle: Vehicle
    track: Track
    note: str
    mission: MissionPlan | None = None

    def from_home(self, home: LocalOrigin, waited_s: float) -> "CompanionFlight":
        if self.mission is None:
            return self
        loaded = track_through(self.mission.waypoints(home), self.vehicle, self.profile, home.up_m)
        settings = replace(self.settings, home=home, gives_up_s=self.settings.gives_up_s - waited_s)
        return self._replace(settings=settings, track=loaded.track, note=loaded.note or self.mission.note)


def plan_of(args: Namespace) -> CompanionFlight:
    profile = load_profile(args.profile).with_choices(args.controller, None)
    vehicle = load_vehicle(args.model or profile.simulation.vehicle)
    name = _track_name(args)
    mission = read_plan(Path(name)) if name.endswith(SUFFIX) else None
    if mission is not None:
        track, note = track_through(mission.waypoints(mission.planned_home), vehicle, profile, 0.0)
    else:
        track, note = load_track(name, vehicle, profile)
    response, thrust_scale = read_response(Path(args.response)) if args.response else (None, 1.0)
    if args.height and not args.arm:
        raise CompanionError("--height is that of the take-off: add --arm, or leave it out")
    if args.arm and args.dry_run:
        raise CompanionError("--dry-run does not arm: leave --arm out")
    settings = CompanionSettings(
        may_arm=args.arm,
        dry_run=args.dry_run,
        duration_s=args.duration,
        takeoff_height_m=args.height or (mission.takeoff_m if mission else None),
        gives_up_s=args.wait,
        limits=FlightLimits(
            margin_m=args.margin,
            max_tilt_deg=args.max_tilt,
            max_error_m=args.max_error,
            max_state_age_s=1e-3 * args.max_age,
            min_pace=0.01 * args.min_pace,
            max_gap_s=1e-3 * args.max_gap,
        ),
        setpoints=SetpointKind(args.setpoints),
        stack=STACKS[args.stack] if args.stack else None,
        response=response,
        identifies=args.identify,
        stay=stay_of(name),
        system=args.system,
        thrust_scale=thrust_scale,
    )
    return CompanionFlight(settings, profile, vehicle, track, note, mission)


def _track_name(args: Namespace) -> str:
    if args.identify:
        if args.track or args.dry_run:
            raise CompanionError("--identify hovers and sends steps: leave TRACK and --dry-run out")
        return f"hover:height={args.height or _IDENTIFIES_AT_M:g}"
    if args.track is None:
        raise CompanionError("name a TRACK to fly, or --identify")
    return str(args.track)


def companion(args: Namespace) -> int:
    with one_line():
        plan = plan_of(args)
        signing, warning = _signing(args.signing_key)
        check_reach([args.vehicle], signed=signing is not None, insecure=args.insecure)
        wire = _Wire(open_ground_link(args.vehicle))
    stop = Stop()
    try:
        if plan.mission is not None:
            peer = VehiclePeer(system=args.system)
            peer.client.sign_with(signing)
            began_s = perf_counter()
            home = _seek_home(wire, peer, args.wait, stop)
            plan = plan.from_home(home, perf_counter() - began_s)
        companion = Companion(plan.settings, plan.profile, plan.vehicle, plan.track, perf_counter)
    except Error as error:
        wire.link.close()
        fail(str(error))
    companion.peer.client.sign_with(signing)
    status = Silent() if args.quiet else Status("companion", as_json=False)
    for note in (warning, plan.note):
        if note:
            status.say("note", note)
    with occupied(args.out):
        summary = FlightSummary()
        try:
            with open(args.out / LOG, "w", newline="", encoding="utf-8", opener=regular) as file, gc_frozen():
                log = _Log(file, summary)
                try:
                    serve(companion, wire, status, stop, log)
                finally:
                    if companion.ended is None:
                        wire.send(companion.last_order())
        except OSError as error:
            fail(f"{args.out / LOG}: {error.strerror}", EXIT_FAILED)
        finally:
            wire.link.close()
        figures = report(companion, summary, args, plan)
        write_report(figures, args.out / REPORT)
        if plan.settings.identifies and companion.ended is not None and companion.ended.in_order:
            if not companion.completed:
                fail(f"the steps were not completed: no fit; logs are in {args.out}", EXIT_FAILED)
            _identify(companion, status, args.out)
    if stop.code and not companion.has_flown and not plan.settings.dry_run:
        fail("ended by a signal before it flew", stop.code)
    return _end(companion, figures, status, args.out)


class _Wire:
    """The link to one vehicle; other senders are ignored until it is silent."""

    def __init__(self, link: GroundLink) -> None:
        self.link = link
        self._address: Address | None = link.target
        self._heard_s: float | None = None
        self._ignored: set[Address] = set()
        self._told: set[Address] = set()

    def receive(self, peer: VehiclePeer, now_s: float) -> Iterator[bytes]:
        """Yield datagrams; who sends the vehicle's HEARTBEAT is the vehicle."""
        for datagram, sender in self.link.receive_now():
            known = self._heard_s is not None and now_s - self._heard_s < _SILENT_S
            if known and sender != self._address:
                if len(self._ignored) < _MAX_IGNORED:
                    self._ignored.add(sender)
                continue
            before_us = peer.report.reported_us.get("heartbeat")
            yield datagram
            if self._heard_s is None:
                self._address = sender
            if (sender == self._address and peer.system) or peer.report.reported_us.get("heartbeat") != before_us:
                self._address, self._heard_s = sender, now_s
        for opened in self.link.take_opened():
            self._address = self._address or opened
        if self._address in self.link.take_closed():
            self._address = self._heard_s = None

    def take_ignored(self) -> list[Address]:
        """Return each new sender once."""
        new = sorted(self._ignored - self._told)
        self._told |= self._ignored
        return new

    def send(self, frames: list[bytes]) -> None:
        for frame in frames:
            if self._address is not None:
                self.link.send(frame, None if self.link.target == self._address else self._address)


def _seek_home(wire: _Wire, peer: VehiclePeer, wait_s: float, stop: Stop) -> LocalOrigin:
    now_s, began_s = 0.0, perf_counter()
    while (home := peer.seek_home(round(now_s * 1e6))) is None:
        now_s = perf_counter() - began_s
        if stop:
            fail("ended by a signal before it flew", stop.code)
        if now_s > wait_s:
            raise CompanionError("a mission needs the vehicle's home position, which was not received")
        for datagram in wire.receive(peer, now_s):
            peer.receive(datagram, round(now_s * 1e6))
        wire.send(peer.poll(round(now_s * 1e6)))
        wire.link.wait(_POLL_S)
    return home


def serve(companion: Companion, wire: _Wire, status: Status, stop: Stop, log: "_Log") -> None:
    began_s = perf_counter()
    tell_s, told = _SAY_FAILING_EVERY_S, list[str]()
    while companion.ended is None:
        now_us = round((perf_counter() - began_s) * 1e6)
        if stop:
            companion.stop(
                f"{signal.Signals(stop.code - 128).name}: it ends, and a vehicle that it flies is handed over"
            )
        for datagram in wire.receive(companion.peer, now_us * 1e-6):
            companion.receive(datagram, now_us)
        try:
            wire.send(companion.poll(now_us))
        except LinkError as error:
            if companion.phase is CompanionPhase.CONNECTING:
                raise
            companion.stop(str(error), fault=True)
        log.write(companion)
        for sender in wire.take_ignored():
            status.say("link", f"{sender[0]}:{sender[1]} is ignored: the link belongs to another vehicle")
        for line in companion.said:
            status.say("phase", line)
        companion.said.clear()
        for note in wire.link.take_notes():
            status.say("link", note)
        for line in companion.peer.report.take_new_texts():
            status.say("vehicle", f"vehicle says: {line}")
        if now_us * 1e-6 > tell_s and companion.waits_for != told:
            tell_s, told = now_us * 1e-6 + _SAY_FAILING_EVERY_S, companion.waits_for
            for line in told:
                status.say("waits", line)
        wire.link.wait(_POLL_S)


class _Log:
    """Writes rows to a file, numbers with nine digits."""

    def __init__(self, file: TextIO, summary: FlightSummary) -> None:
        self._file, self._summary, self._broken = file, summary, False
        self._writer = csv.writer(file)
        self._writer.writerow(LogRow._fields)

    def write(self, companion: Companion) -> None:
        for row in companion.rows:
            self._summary.add(row)
        try:
            for row in companion.rows if not self._broken else ():
                self._writer.writerow(f"{value:.9g}" if isinstance(value, float) else value for value in row)
        except OSError as error:
            self._broken = True
            companion.stop(f"{LOG} cannot be written: {error.strerror}", fault=True)
        companion.rows.clear()


def _signing(path: Path | None) -> tuple[Signing | None, str]:
    if path is None:
        return None, ""
    try:
        key, warning = read_key(path)
    except (OSError, SigningError) as error:
        raise CompanionError(f"--signing-key {path}: {getattr(error, 'strerror', error)}") from error
    return Signing(key, lambda: tick_at(time())), warning and f"--signing-key {path}: {warning}"


def _identify(companion: Companion, status: Status, out: Path) -> None:
    from colibri.companion.identification import draw, identified

    try:
        found, text, fitted = identified(companion)
    except Error as error:
        fail(f"{error}; logs are in {out}", EXIT_FAILED)
    (out / RESPONSE).write_text(text, encoding="utf-8")
    draw(fitted, out / FIGURE)
    lags = ", ".join(f"{1e3 * lag_s:.0f}" for lag_s in found.time_constant_s)
    status.say("identified", f"time constants {lags} ms after {1e3 * found.latency_s:.0f} ms: {out / RESPONSE}")


def _end(companion: Companion, figures: dict[str, Any], status: Status, out: Path) -> int:
    ended = companion.ended
    assert ended is not None, "it was served until then"
    handle_endings(signal.SIG_IGN)  # a second signal while Python ends would be its exit code
    if figures["control_rmse_m"] is not None:
        status.say(
            "report",
            f"estimate from track, RMS {length(figures['control_rmse_m'])}, at most {length(figures['max_error_m'])}; "
            f"written to {out}",
        )
    if ended.in_order:
        return 0
    fail(f"{ended.why}; logs are in {out}", EXIT_FAILED)


def report(companion: Companion, summary: FlightSummary, args: Namespace, plan: CompanionFlight) -> dict[str, Any]:
    errors, peer, ended = companion.errors, companion.peer, companion.ended
    return {
        "track": args.track or "identification",
        "track_note": plan.note,
        "profile": plan.profile.name,
        "controller": plan.profile.controller,
        "link": args.vehicle,
        "vehicle": plan.vehicle.name,
        "setpoint_kind": plan.settings.setpoints.value,
        "dry_run": plan.settings.dry_run,
        "duration_s": _finite(plan.settings.duration_s),
        "stack": peer.stack.name if peer.stack else None,
        "feedback": "the vehicle's estimate",
        "ended": "interrupted" if ended is None else ended.why,
        "in_order": ended is not None and ended.in_order,
        "lost": None if ended is None or ended.in_order else ended.why,
        "limit": companion.limit.name if companion.limit else None,
        "phases": summary.phases,
        "sim_time_s": errors.flown_s,
        "wall_time_s": summary.last_s - summary.first_s,
        "states_on_track": errors.samples,
        "rmse_m": _finite(errors.rmse_m()),
        "max_error_m": _finite(errors.max_m),
        "rmse_after_20s_m": _finite(errors.rmse_m(SETTLED_AFTER_S)),
        "control_rmse_m": _finite(errors.rmse_m()),
        "max_tilt_deg": degrees(summary.max_tilt_rad),
        "setpoints": summary.sent,
        "setpoint_rate_hz": _finite(summary.rate_hz),
        "fallbacks": {str(fallback): summary.fallbacks[fallback] for fallback in Fallback},
        "round_trip_ms": peer.clock.round_trip_us * 1e-3,
        "state_delay_ms": peer.state_delay_s * 1e3,
        "max_state_age_ms": summary.max_age_s * 1e3,
        "thrust_scale": companion.thrust_scale,
        "parameters": peer.parameter_values,
    }


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None
