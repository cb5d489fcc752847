"""The autopilot's own logs of a flight."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from colibri.autopilot.control.interface import FALLBACK_CODES, STATUS_CODES, Active
from colibri.autopilot.core.step import Step
from colibri.autopilot.estimation.estimate import Estimate
from colibri.autopilot.estimation.measurements.table import kinds_of
from colibri.autopilot.process.flight_topics import FlightTopics
from colibri.autopilot.process.recorded_inputs import ReceivedDatagram, Setup, line
from colibri.common.process.log_files import CsvLog, LogError, LogFile
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.parameters.store import Value
from colibri.mavlink.telemetry.snapshot import Snapshot

if TYPE_CHECKING:
    from colibri.autopilot.core.step import Received


DECISION_COLUMNS = (
    *("t", "phi_ref", "theta_ref", "psi_ref"),
    *("qp_status", "fallback", "solve_time_us", "control_step_us", "cost", "slack"),
    *(f"active_{kind}" for kind in Active._fields),
    "delay_us",
    "mass_kg",
    "path_lag_s",
    "qp_iterations",
)

ESTIMATE_COLUMNS = (
    *("t", "x", "y", "z", "vx", "vy", "vz", "qw", "qx", "qy", "qz", "p", "q", "r"),
    *(f"sd_{name}" for name in ("x", "y", "z", "vx", "vy", "vz", "east", "north", "up")),
    *("gyro_bias_x", "gyro_bias_y", "gyro_bias_z", "accel_bias_x", "accel_bias_y", "accel_bias_z"),
    *("flags", "rejected", "resets"),
)
_CHECK_COLUMNS = (
    *("t", "x", "y", "z", "vx", "vy", "vz", "qw", "qx", "qy", "qz"),
    *(f"P{row}{column}" for row in range(9) for column in range(row, 9)),
)


def check_columns(kinds: Sequence[str]) -> tuple[str, ...]:
    """Return the columns of `filter.csv` for a vehicle that has these kinds of measurements."""
    return (*_CHECK_COLUMNS, *(f"nis_{kind}" for kind in kinds), *(f"believed_{kind}" for kind in kinds))


class AutopilotLog:
    """What the autopilot writes: its start, what it received, one row a control sample, and what it estimates then.

    Attributes:
        topics: What it writes to `flight.ulg`; None where it writes none.
    """

    def __init__(self, folder: Path, setup: Setup, *, ulog: bool = True) -> None:
        """Create `autopilot.csv` and `inputs.jsonl` in `folder`; on sensors also `estimate.csv` and `filter.csv`.

        What is received is appended to what the process before received: it may have died in mid-flight.
        """
        self._setup = setup
        self._begins = True
        self._time_us = 0
        self._inputs = LogFile(folder / "inputs.jsonl", "ab")
        self._decisions = CsvLog(folder / "autopilot.csv", DECISION_COLUMNS)
        self._estimates = self._checks = None
        if setup.feedback is Feedback.SENSORS:
            self._estimates = CsvLog(folder / "estimate.csv", ESTIMATE_COLUMNS)
            vehicle = setup.vehicle_tables
            kinds = kinds_of(vehicle.sensors) if vehicle and vehicle.sensors else []
            self._checks = CsvLog(folder / "filter.csv", check_columns(kinds))
        self.topics = FlightTopics(folder, setup) if ulog else None
        self._untold: tuple[Step, tuple[float, ...]] | None = None
        self._rows = [log for log in (self._decisions, self._estimates, self._checks) if log is not None]

    def write(self, step: Step) -> None:
        """Append a control sample; of a frame between two of them, only the check of the filter.

        Topics of a sample are written with the next frame: where that is between samples, there is time for it.
        """
        self._tell()
        if step.command.time_us < self._time_us and self.topics:
            self.topics.begin_again()
        self._time_us = step.command.time_us
        if self.topics:
            self.topics.begin()
        if self._begins:
            self._begins = False
            self._inputs.append(line(msgspec.structs.replace(self._setup, first_us=self._time_us)))
        if self._checks is not None and step.estimate is not None and step.estimate.check is not None:
            check = step.estimate.check
            self._checks.add((check.time_us / 1e6, *check.state, *check.covariance, *check.nis, *check.accepted))
        if step.decision is None:
            return
        if self._estimates is not None and step.estimate is not None:
            self._write_estimate(self._estimates, step.estimate)
        how = step.decision.diagnostics
        codes = (STATUS_CODES[how.qp_status], FALLBACK_CODES[how.fallback])
        times_us = (how.solve_time_s * 1e6, step.duration_s * 1e6)
        counts = (how.cost, how.slack, *how.active, step.delay_us, how.mass_kg, how.path_lag_s, how.qp_iterations)
        decided = (*step.decision.attitude_reference, *codes, *times_us, *counts)
        self._decisions.add((step.command.time_us / 1e6, *decided))
        if self.topics and not self._setup.ground:
            self._untold = (step, decided)

    def write_snapshot(self, snapshot: Snapshot) -> None:
        """Append what ground stations are told.

        Raises:
            LogError: It cannot be written.
        """
        if self.topics:
            self.topics.write_snapshot(snapshot)

    def say(self, time_us: int, severity: int, text: str) -> None:
        """Append a line that ground stations are told.

        Raises:
            LogError: It cannot be written.
        """
        if self.topics:
            self.topics.say(time_us, severity, text)

    def begin_again(self, values: Mapping[str, Value], history: bytes) -> None:
        """Record that the next frame is answered by a vehicle that begins with these parameters and this history."""
        self._setup = msgspec.structs.replace(self._setup, values=dict(values), history=history)
        self._begins = True

    def recorded(self, datagrams: Iterable["Received"]) -> Iterator["Received"]:
        """Yield what ground stations sent, and record it.

        Raises:
            LogError: Once all is yielded, if something could not be recorded.
        """
        failed: LogError | None = None
        for received in datagrams:
            datagram, link, address, loopback = received
            entry = ReceivedDatagram(
                time_us=self._time_us, link=link, address=address, loopback=loopback, datagram=datagram
            )
            try:
                self._inputs.append(line(entry))
            except LogError as error:
                failed = error
            yield received
        if failed:
            raise failed

    def flush(self) -> None:
        """Write what waits.

        Raises:
            LogError: It cannot be written.
        """
        self._tell()
        for log in self._rows:
            log.flush()
        if self.topics:
            self.topics.flush()

    def close(self) -> None:
        """Close the files."""
        with suppress(LogError):
            self._tell()
        for log in (self._inputs, *self._rows):
            log.close()
        if self.topics:
            self.topics.close()

    def _tell(self) -> None:
        """Write the topics of the last sample, unless that is done."""
        untold, self._untold = self._untold, None
        if self.topics and untold:
            self.topics.write(*untold)

    def _write_estimate(self, log: CsvLog, estimate: Estimate) -> None:
        frame = estimate.frame
        state = (*frame.position_enu_m, *frame.velocity_enu_m_s, *frame.attitude, *frame.rate_flu_rad_s)
        deviations = (*estimate.position_std_m, *estimate.velocity_std_m_s, *estimate.attitude_std_rad)
        biases = (*estimate.gyro_bias_rad_s, *estimate.accel_bias_m_s2)
        counts = (estimate.health.flags, sum(estimate.rejected.values()), estimate.resets)
        log.add((frame.time_us / 1e6, *state, *deviations, *biases, *counts))
