"""The autopilot as a process: calls a plant over a link, answers its frames, logs what it decided."""

import argparse
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import msgspec

from autopilot.controller import FALLBACK_CODES, STATUS_CODES, Active, ControllerError, DecisionError
from autopilot.core import Autopilot, Step
from autopilot.estimate import Estimate, Tests
from autopilot.inputs import Heard, Setup, line
from autopilot.profile import Profile, ProfileError, load_profile
from autopilot.qp import SolverError
from autopilot.senses import Estimator, estimator_for
from autopilot.tracks import TrackError, track
from mavlink.dialect import RESULT_UNSUPPORTED
from mavlink.feedback import Feedback
from mavlink.link import LinkError, OneByOne, UdpLink, open_link
from mavlink.lockstep import AutopilotEnd
from mavlink.parameters import Value
from mavlink.process import EXIT_FAILED, EXIT_INTERRUPTED, CsvLog, LineLog, Status, Stop, fail, undisturbed
from mavlink.px4_flier import FlierEnd
from plant.vehicle import Vehicle, VehicleError, load_vehicle

if TYPE_CHECKING:
    from autopilot.copter import Copter, Received
    from autopilot.ground_process import Ground

DECISION_COLUMNS = (
    *("t", "phi_ref", "theta_ref", "psi_ref"),
    *("qp_status", "fallback", "solve_time_us", "control_step_us", "cost", "slack"),
    *(f"active_{kind}" for kind in Active._fields),
)

ESTIMATE_COLUMNS = (
    *("t", "x", "y", "z", "vx", "vy", "vz", "qw", "qx", "qy", "qz", "p", "q", "r"),
    *(f"sd_{name}" for name in ("x", "y", "z", "vx", "vy", "vz", "east", "north", "up")),
    *("gyro_bias_x", "gyro_bias_y", "gyro_bias_z", "accel_bias_x", "accel_bias_y", "accel_bias_z"),
    *("flags", "rejected", "resets"),
)
CHECK_COLUMNS = (
    *("t", "x", "y", "z", "vx", "vy", "vz", "qw", "qx", "qy", "qz"),
    *(f"P{row}{column}" for row in range(9) for column in range(row, 9)),
    *(f"nis_{kind}" for kind in Tests._fields),
    *(f"believed_{kind}" for kind in Tests._fields),
)

TRACK = "spiral"
"""What flies where nothing else is said."""
_SILENCE_SAID_AFTER_S = 2.0
_WAIT_AT_MOST_S = 0.1
_UNKNOWN_SAID_AFTER_US = 3_000_000
"""Of simulated time: who rests is known after a second."""
_UNKNOWN = "no estimate yet: the vehicle must rest for a second, with a GPS fix; until then the rotors stand"


def _refusal(result: int) -> str:
    if result == RESULT_UNSUPPORTED:
        return "the plant's vehicle has no sensors"
    return "the plant flies at another frame rate or feedback, and will not change it in mid-flight"


class AutopilotLog:
    """What the autopilot writes: what it began with and heard, one row a control sample, and what it estimates then."""

    def __init__(self, folder: Path, setup: Setup) -> None:
        """Create `autopilot.csv` and `inputs.jsonl` in `folder`; on sensors also `estimate.csv` and `filter.csv`.

        What was heard goes to the end of what the process before heard: it may have died in mid-flight.
        """
        self._setup = setup
        self._begins = True
        self._time_us = 0
        self._inputs = LineLog(folder / "inputs.jsonl")
        self._decisions = CsvLog(folder / "autopilot.csv", DECISION_COLUMNS)
        self._estimates = self._checks = None
        if setup.feedback is Feedback.SENSORS:
            self._estimates = CsvLog(folder / "estimate.csv", ESTIMATE_COLUMNS)
            self._checks = CsvLog(folder / "filter.csv", CHECK_COLUMNS)

    def write(self, step: Step) -> None:
        """Append a control sample; a frame between two of them has nothing to tell but how the filter stands."""
        self._time_us = step.command.time_us
        if self._begins:
            self._begins = False
            self._inputs.write(line(msgspec.structs.replace(self._setup, first_us=self._time_us)))
        if self._checks is not None and step.estimate is not None and step.estimate.check is not None:
            check = step.estimate.check
            self._checks.write((check.time_us / 1e6, *check.state, *check.covariance, *check.nis, *check.believed))
        if step.decision is None:
            return
        if self._estimates is not None and step.estimate is not None:
            self._write_estimate(self._estimates, step.estimate)
        how = step.decision.diagnostics
        codes = (STATUS_CODES[how.qp_status], FALLBACK_CODES[how.fallback])
        times_us = (how.solve_time_s * 1e6, step.duration_s * 1e6)
        time_s = step.command.time_us / 1e6
        self._decisions.write(
            (time_s, *step.decision.attitude_reference, *codes, *times_us, how.cost, how.slack, *how.active)
        )

    def begin_again(self, values: Mapping[str, Value], past: bytes) -> None:
        """Note that the next frame is answered by a vehicle that begins with these parameters, and with this past."""
        self._setup = msgspec.structs.replace(self._setup, values=dict(values), past=past)
        self._begins = True

    def hear(self, datagrams: Iterable["Received"]) -> Iterator["Received"]:
        """Pass on what ground stations sent, and note it."""
        for received in datagrams:
            datagram, link, address, loopback = received
            heard = Heard(time_us=self._time_us, link=link, address=address, loopback=loopback, datagram=datagram)
            self._inputs.write(line(heard))
            yield received

    def close(self) -> None:
        """Close the files."""
        for log in (self._inputs, self._decisions, self._estimates, self._checks):
            if log is not None:
                log.close()

    def _write_estimate(self, log: CsvLog, estimate: Estimate) -> None:
        frame = estimate.frame
        state = (*frame.position_enu_m, *frame.velocity_enu_m_s, *frame.attitude, *frame.rate_flu_rad_s)
        deviations = (*estimate.position_std_m, *estimate.velocity_std_m_s, *estimate.attitude_std_rad)
        biases = (*estimate.gyro_bias_rad_s, *estimate.accel_bias_m_s2)
        counts = (int(estimate.health.flags), sum(estimate.rejected.values()), estimate.resets)
        log.write((frame.time_us / 1e6, *state, *deviations, *biases, *counts))


def run(args: argparse.Namespace, link: UdpLink | OneByOne, status: Status, stop: Stop) -> int:
    """Fly the plant at the other end of `link` as the command line says; return the exit code."""
    try:
        profile = load_profile(args.profile).with_choices(args.controller, args.solver)
        vehicle = load_vehicle(args.vehicle or profile.simulation.vehicle)
        estimator = estimator_for(args.feedback, vehicle, args.home.origin)
        served = args.gcs or args.conducted
        ground = _ground(args, profile, vehicle, estimator, status, stop) if served else None
        autopilot = ground.copter if ground else _alone(args, profile, vehicle, estimator)
        end = _flier(args, vehicle) if args.simulator else _end(args, autopilot.frame_interval_us)
    except (ProfileError, VehicleError, TrackError, ControllerError, SolverError, LinkError) as error:
        fail(str(error))
    log = AutopilotLog(args.out, _setup(args, profile)) if args.out else None
    if ground and log:
        ground.record(log)
    if args.conducted and isinstance(link, UdpLink):  # several flights share the cores: who waits gives way at once
        link.spin_s = 0.0
    try:
        with undisturbed():
            Client(link, end, status, stop, log, ground).fly(autopilot)
    except (LinkError, DecisionError) as error:
        fail(str(error), EXIT_FAILED)
    finally:
        link.close()
        if ground:
            ground.close()
        if log:
            log.close()
    return 0 if ground and ground.shut_down else EXIT_INTERRUPTED


def _setup(args: argparse.Namespace, profile: Profile) -> Setup:
    served = bool(args.gcs or args.conducted)
    return Setup(
        profile=args.profile,
        controller=profile.controller,
        solver=args.solver,
        vehicle=args.vehicle or profile.simulation.vehicle,
        feedback=args.feedback,
        track=args.track if served else args.track or TRACK,
        origin=args.home.origin,
        system_id=args.system_id,
        identity=args.identity,
        ground=served,
    )


def _end(args: argparse.Namespace, frame_interval_us: int) -> AutopilotEnd:
    return AutopilotEnd(
        system_id=args.system_id, frame_interval_us=frame_interval_us, now_s=perf_counter(), feedback=args.feedback
    )


def _flier(args: argparse.Namespace, vehicle: Vehicle) -> FlierEnd:
    """Return what flies a simulator that counts the rotors as PX4 does.

    Raises:
        VehicleError: PX4 cannot count them.
    """
    rotors, order = vehicle.rotors, vehicle.rotors.numbering()
    return FlierEnd(
        system_id=args.system_id,
        now_s=perf_counter(),
        to_motors=lambda speeds: rotors.controls_of(order.to_motors(speeds)),
    )


def _alone(args: argparse.Namespace, profile: Profile, vehicle: Vehicle, estimator: Estimator | None) -> Autopilot:
    return Autopilot(profile, vehicle, track(args.track or TRACK), perf_counter, estimator=estimator)


def _ground(
    args: argparse.Namespace,
    profile: Profile,
    vehicle: Vehicle,
    estimator: Estimator | None,
    status: Status,
    stop: Stop,
) -> "Ground":
    """Load what serves ground stations only where there are any: it is as much as all the rest."""
    from autopilot.conducted import UdpConductor
    from autopilot.ground_process import open_ground

    conductor = None
    if args.conducted:
        link = open_link(args.conducted)
        link.spin_s = 0.0
        conductor = UdpConductor(link, lambda: stop)
    return open_ground(args, profile, vehicle, estimator, status, conductor)


class Client:
    """Drives the autopilot's end of the conversation over a link."""

    def __init__(
        self,
        link: UdpLink | OneByOne,
        end: AutopilotEnd | FlierEnd,
        status: Status,
        stop: Stop,
        log: AutopilotLog | None,
        ground: "Ground | None" = None,
    ) -> None:
        """Serve `end` on `link` until `stop`, and `ground` beside it."""
        self._link = link
        self._end = end
        self._status = status
        self._stop = stop
        self._log = log
        self._ground = ground
        self._frame_came = self._heard = False
        self._refusal_said = self._unknown_said = False
        self._unknown_since_us: int | None = None

    def fly(self, autopilot: "Autopilot | Copter") -> None:
        """Answer every frame until told to stop."""
        self._status.say("calling", "waiting for the plant at " + self._link.url.partition(":")[2])
        due_s = 0.0
        while not self._stop:
            received = self._link.receive(min(max(0.0, due_s - perf_counter()), _WAIT_AT_MOST_S))
            step = self._answer(autopilot, received[0]) if received else None
            due_s = self._end.poll(perf_counter())
            for datagram in self._end.take_outbox():
                self._link.send(datagram)
            if step and self._log:
                self._log.write(step)  # while the plant integrates
            if step and self._ground:
                autopilot = self._ground.serve(perf_counter())
                if self._ground.shut_down:
                    break
            self._say_what_changed()
        self._status.say("ended", "ended", repeated=self._end.repeated, dropped=dict(self._end.dropped))

    def _answer(self, autopilot: "Autopilot | Copter", datagram: bytes) -> Step | None:
        frame = self._end.receive(datagram, perf_counter())
        if frame is None:
            return None
        self._frame_came = True
        autopilot.hear(self._end.aside)
        step = autopilot.step(frame)
        self._end.answer(step.command, step.faults)
        self._say_if_unknown(step)
        return step

    def _say_if_unknown(self, step: Step) -> None:
        """Say, once, why a vehicle lies there disarmed, or falls."""
        now_us = step.command.time_us
        if step.known:
            self._unknown_since_us = None
        elif self._unknown_since_us is None or now_us < self._unknown_since_us:
            self._unknown_since_us, self._unknown_said = now_us, False
        elif now_us - self._unknown_since_us >= _UNKNOWN_SAID_AFTER_US and not self._unknown_said:
            self._unknown_said = True
            self._status.say("unknown", _UNKNOWN)

    def _say_what_changed(self) -> None:
        silent = self._end.silence_s(perf_counter()) > _SILENCE_SAID_AFTER_S
        if not self._heard and self._frame_came and not silent:
            self._heard = True
            self._status.say("flying", "the plant sends frames")
        elif self._heard and silent:
            self._frame_came = self._heard = False
            self._status.say("silence", f"no frame for {_SILENCE_SAID_AFTER_S:.0f} s, waiting for a plant")
        if self._end.refused is not None and not self._refusal_said:
            self._refusal_said = True
            self._status.say("refused", _refusal(self._end.refused))
