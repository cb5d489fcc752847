"""The autopilot's records of a flight."""

from collections.abc import Iterable, Iterator, Mapping
from math import nan
from pathlib import Path

import msgspec

from colibri.autopilot.commander.rules.modes import Mode, custom_mode
from colibri.autopilot.control.interface import FALLBACK_CODES, STATUS_CODES, Fallback, Horizon
from colibri.autopilot.core.step import Received, Step
from colibri.autopilot.estimation.estimate import Estimate, FilterCheck
from colibri.autopilot.estimation.health import estimator_state
from colibri.autopilot.estimation.measurements.table import kinds_of
from colibri.autopilot.parameters.definitions import definitions
from colibri.autopilot.process.recorded_inputs import ReceivedDatagram, Setup
from colibri.common.process.log_files import LogError
from colibri.common.process.shared_log import SharedLog
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.sensors import SensorFrame
from colibri.mavlink.hil.state import STATE_BYTES, ActuatorCommand, StateFrame
from colibri.mavlink.parameters.store import Parameters, Value
from colibri.mavlink.services.statustext import ERROR, INFO, WARNING
from colibri.mavlink.telemetry.snapshot import TelemetrySnapshot
from colibri.mavlink.ulog import messages
from colibri.mavlink.ulog.blocks import Thinning
from colibri.mavlink.ulog.flight_topics import COMMAND, DECISION, ESTIMATE, FILTER, MEASURED, MORE_COMMAND, split
from colibri.mavlink.ulog.inputs import RecordKind, encode_input
from colibri.mavlink.ulog.log import FileLog, TopicLog, beginning
from colibri.mavlink.ulog.reader import FILE
from colibri.mavlink.ulog.recorder import STATUS_EVERY_US, Recorder
from colibri.mavlink.ulog.samples import SampleBlocks, SensingBlocks, VehicleStatus, sensing_numbers, status_message

MAX_RECEIVED_BYTES = 64 << 20  # limit of logged datagrams: a flood must not fill the disk
MAX_SAID_BYTES = 16 << 20  # limit of status texts below the severity of errors
_FULL = f"stations have sent more than {MAX_RECEIVED_BYTES >> 20} MiB: no more is recorded, a replay ends here"
_FLYING = VehicleStatus(armed=True, custom_mode=custom_mode(Mode.TRACK))
_NO_REFERENCES = (nan,) * 11


class AutopilotLog:
    """Records samples, inputs and PX4's topics; raises LogError."""

    def __init__(self, topics: TopicLog, setup: Setup) -> None:
        self.topics, self._setup = topics, setup
        self._begins = True
        self._time_us = self._received_bytes = self._said_bytes = 0
        vehicle = setup.vehicle_tables
        self._kinds = kinds_of(vehicle.sensors) if vehicle.sensors else []
        self._rotors = vehicle.rotors.count
        self._recorder: Recorder | None = None
        self._views: tuple[SampleBlocks, SensingBlocks] | None = None
        self._own_beginning = b""
        if topics.for_viewers and not setup.ground:
            self._views = (SampleBlocks(self._rotors), SensingBlocks())
            known = definitions(setup.profile_tables, vehicle, setup.system_id)
            self._own_beginning = beginning(vehicle.name, Parameters(known).values)
        self._status_us, self._thinning = -1, Thinning()
        self._fallback: Fallback | None = None

    def write(self, step: Step, datagram: bytes | None = None, repeated_us: Iterable[int] = ()) -> None:
        """Append a control sample; between samples, only command and filter check.

        The `datagram` is empty where only the state was sent, and None in a replay; `repeated_us` has the times of
        later frames with the same command.
        """
        time_us, decision, estimate = step.command.time_us, step.decision, step.estimate
        if time_us < self._time_us:
            self.topics.close()
            self._received_bytes = self._said_bytes = 0
            self._status_us, self._thinning = -1, Thinning()
            self._fallback, self._begins = None, True
        self._time_us = time_us
        if self.topics.for_viewers:
            self._write_input(step.command, datagram, repeated_us)
        if estimate is not None and estimate.check is not None:
            self.topics.add(FILTER, self._check_row(estimate.check))
        if decision is None:
            return
        if estimate is not None:
            self.topics.add(ESTIMATE, _estimate_row(estimate))
        _, reference, how = decision
        status, fallback, solve_time_s, cost, active, slack, _, _, mass_kg, path_lag_s, iterations = how
        decided = (
            *reference, STATUS_CODES[status], FALLBACK_CODES[fallback], solve_time_s * 1e6,
            step.duration_s * 1e6, cost, slack, *active, step.delay_us, mass_kg, path_lag_s, iterations,
        )  # fmt: skip
        self.topics.add(DECISION, (time_us, *decided))
        if self._views is not None:
            self._note(time_us, fallback)
            if self._thinning.is_due(time_us):
                self._view(*self._views, step, decided)

    def follow(self, parameters: Parameters) -> None:
        name = self._setup.vehicle_tables.name
        self._recorder = Recorder(self.topics, name, self._setup.system_id, parameters, with_battery=False)

    def beginning(self) -> bytes:
        return self._own_beginning if self._recorder is None else self._recorder.begin()

    def write_snapshot(self, snapshot: TelemetrySnapshot) -> None:
        if self._recorder is not None:
            self._recorder.update(snapshot)

    def say(self, time_us: int, severity: int, text: str) -> None:
        line = messages.logged_string(time_us, severity, text)
        said_bytes, self._said_bytes = self._said_bytes, self._said_bytes + len(line)
        if said_bytes < MAX_SAID_BYTES or severity <= ERROR:
            self.topics.append(line)
            if said_bytes < MAX_SAID_BYTES <= self._said_bytes:
                self.topics.append(messages.logged_string(time_us, WARNING, "too many texts: only errors from now on"))

    def begin_again(self, values: Mapping[str, Value], history: bytes) -> None:
        self._setup = msgspec.structs.replace(self._setup, values=dict(values), history=history)
        self._begins = True

    def recorded(self, datagrams: Iterable[Received]) -> Iterator[Received]:
        """Record and yield datagrams; raise LogError after the last."""
        failed: LogError | None = None
        for received in datagrams:
            try:
                self._record(*received)
            except LogError as error:
                failed = error
            yield received
        if failed:
            raise failed

    def _record(self, datagram: bytes, link: int, address: tuple[str, int] | None, owner: bool) -> None:
        if self._received_bytes > MAX_RECEIVED_BYTES:
            return
        entry = ReceivedDatagram(link=link, address=address, loopback=owner, datagram=datagram)
        record = encode_input(self._time_us, RecordKind.DATAGRAM, msgspec.json.encode(entry))
        self._received_bytes += len(record)
        if self._received_bytes > MAX_RECEIVED_BYTES:
            self.say(self._time_us, WARNING, _FULL)
            raise LogError(_FULL)
        self.topics.append(record)

    def flush(self) -> None:
        self.topics.flush()

    def close(self) -> None:
        self.topics.close()

    def _write_input(self, command: ActuatorCommand, datagram: bytes | None, repeated_us: Iterable[int]) -> None:
        """Write the inputs of a replay; frames of states follow from the truth."""
        time_us = command.time_us
        if self._begins:
            self._begins = False
            setup = msgspec.structs.replace(self._setup, first_us=time_us)
            self.topics.begin(self.beginning())
            self.topics.append(encode_input(time_us, RecordKind.SETUP, msgspec.json.encode(setup)))
        if datagram is None:
            return
        if datagram and (self._setup.feedback is Feedback.SENSORS or len(datagram) != STATE_BYTES):
            self.topics.queue(encode_input(time_us, RecordKind.FRAME, datagram))
        first, others = split(command.controls)
        for each_us in (time_us, *repeated_us):
            self.topics.add(COMMAND, (each_us, *first, command.armed))
            if others:
                self.topics.add(MORE_COMMAND, (each_us, *others))

    def _note(self, time_us: int, fallback: Fallback | None) -> None:
        setup = self._setup
        if self._status_us < 0:
            self.say(time_us, INFO, f"{setup.track or 'no track'}, profile {setup.profile}, {setup.controller}")
        if time_us >= self._status_us:
            self._status_us = time_us + STATUS_EVERY_US
            self.topics.append(status_message(time_us, _FLYING, setup.system_id, self._rotors))
        if fallback is not self._fallback:
            self._fallback = fallback
            said = (INFO, "the QP is solved again") if fallback is None else (WARNING, f"fallback: {fallback}")
            self.say(time_us, *said)

    def _view(self, samples: SampleBlocks, sensings: SensingBlocks, step: Step, decided: tuple[float, ...]) -> None:
        estimate, frame = step.estimate, step.frame
        known = frame if estimate is None else estimate.frame
        if not isinstance(known, StateFrame):
            return
        motion = (*known.position_enu_m, *known.velocity_enu_m_s, *known.attitude, *known.rate_flu_rad_s)
        controls, others = split(step.command.controls if step.command.armed else (nan,) * self._rotors)
        references = _NO_REFERENCES if step.references is None else _first(step.references)
        row = (self._time_us, *motion, *controls, *references, *decided, *others)
        self.topics.add(samples, row)
        if estimate is not None and isinstance(frame, SensorFrame):
            self.topics.add(sensings, sensing_numbers(self._time_us, frame, estimator_state(estimate)))

    def _check_row(self, check: FilterCheck) -> tuple[float, ...]:
        nis, accepted = (dict(zip(self._kinds, each, strict=True)) for each in (check.nis, check.accepted))
        counts = (*(nis.get(kind, nan) for kind in MEASURED), *(accepted.get(kind, nan) for kind in MEASURED))
        return (check.time_us, *check.state, *check.covariance, *counts)


def log_in(folder: Path, setup: Setup) -> AutopilotLog:
    """Return a log whose file is created with the first frame."""
    log = AutopilotLog(FileLog(lambda: SharedLog(folder / FILE, log.beginning())), setup)
    return log


def _estimate_row(estimate: Estimate) -> tuple[float, ...]:
    frame = estimate.frame
    state = (*frame.position_enu_m, *frame.velocity_enu_m_s, *frame.attitude, *frame.rate_flu_rad_s)
    deviations = (*estimate.position_std_m, *estimate.velocity_std_m_s, *estimate.attitude_std_rad)
    biases = (*estimate.gyro_bias_rad_s, *estimate.accel_bias_m_s2)
    counts = (estimate.health.flags, sum(estimate.rejected.values()), estimate.resets)
    return (frame.time_us, *state, *deviations, *biases, *counts)


def _first(references: Horizon) -> tuple[float, ...]:
    position, velocity, acceleration, _, _, yaw, yaw_rate, _ = references
    p, v, a = position.item, velocity.item, acceleration.item
    return (p(0), p(1), p(2), v(0), v(1), v(2), a(0), a(1), a(2), yaw.item(0), yaw_rate.item(0))
