"""`flight.ulg` as the autopilot writes it, beside the plant, which writes the truth to the same file."""

from contextlib import suppress
from math import nan
from pathlib import Path

from colibri.autopilot.commander.rules.modes import Mode, custom_mode
from colibri.autopilot.control.interface import Fallback, Horizon
from colibri.autopilot.core.step import Step
from colibri.autopilot.estimation.health import estimator_state
from colibri.autopilot.parameters.definitions import definitions
from colibri.autopilot.process.recorded_inputs import Setup
from colibri.common.process.log_files import LogError
from colibri.common.process.shared_log import SharedLog
from colibri.mavlink.hil.sensors import SensorFrame
from colibri.mavlink.hil.state import StateFrame
from colibri.mavlink.parameters.store import Parameters
from colibri.mavlink.services.statustext import INFO, WARNING
from colibri.mavlink.telemetry.snapshot import Snapshot
from colibri.mavlink.ulog import messages
from colibri.mavlink.ulog.beginning import beginning
from colibri.mavlink.ulog.recorder import STATUS_EVERY_US, Recorder
from colibri.mavlink.ulog.samples import SampleBlocks
from colibri.mavlink.ulog.sensing import SensingBlocks, sensing_numbers
from colibri.mavlink.ulog.status import Status, status_message

NAME = "flight.ulg"
_FLYING = Status(armed=True, custom_mode=custom_mode(Mode.TRACK))
_STILL = (nan,) * 4
_NO_REFERENCES = (nan,) * 11


class FlightTopics:
    """Writes control samples as topics: those of a track from its steps, those of ground stations from snapshots.

    The file is opened with the first frame that is answered.
    """

    def __init__(self, folder: Path, setup: Setup) -> None:
        """Write to `flight.ulg` in `folder`, of a flight that begins with `setup`."""
        self._path = folder / NAME
        self._setup = setup
        self._file: SharedLog | None = None
        self._recorder: Recorder | None = None
        self._samples, self._sensings = SampleBlocks(), SensingBlocks()
        self._status_us = 0
        self._fallback: Fallback | None = None
        self._beginning = b""
        profile, vehicle = setup.profile_tables, setup.vehicle_tables
        self._vehicle = setup.vehicle if vehicle is None else vehicle.name
        if profile is not None and vehicle is not None and not setup.ground:
            parameters = Parameters(definitions(profile, vehicle, setup.system_id))
            self._beginning = beginning(self._vehicle, parameters.values)

    def follow(self, parameters: Parameters) -> None:
        """Write the snapshots of a vehicle with these parameters from now on."""
        self._recorder = Recorder(self._vehicle, self._setup.system_id, parameters, with_battery=False)
        self._beginning = self._beginning or self._recorder.begin()

    def begin(self) -> None:
        """Have the file begun, with parameters, before the plant's first block comes, which knows none.

        Raises:
            LogError: It cannot be written.
        """
        self._begun()

    def begin_again(self) -> None:
        """Begin anew, as time begins again: another plant flies another flight."""
        self.close()
        self._file, self._status_us, self._fallback = None, 0, None

    def write(self, step: Step, decided: tuple[float, ...]) -> None:
        """Write a control sample of a track; `decided` is what `autopilot.csv` has of it, but for the time.

        Raises:
            LogError: It cannot be written.
        """
        time_us, estimate, frame = step.command.time_us, step.estimate, step.frame
        known = frame if estimate is None else estimate.frame
        if not isinstance(known, StateFrame) or step.decision is None:
            return
        self._note(time_us, step.decision.diagnostics.fallback)
        _, place, velocity, attitude, rates = known
        controls = step.command.controls if step.command.armed else _STILL
        references = _NO_REFERENCES if step.references is None else _first(step.references)
        row = (time_us, *place, *velocity, *attitude, *rates, *controls, *references, *decided)
        self._append(self._samples.add(row))
        if estimate is not None and isinstance(frame, SensorFrame):
            self._append(self._sensings.add(sensing_numbers(time_us, frame, estimator_state(estimate))))

    def _note(self, time_us: int, fallback: Fallback | None) -> None:
        """Write status and texts that are due."""
        setup = self._setup
        if self._status_us == 0:
            self.say(time_us, INFO, f"{setup.track or 'no track'}, profile {setup.profile}, {setup.controller}")
        if time_us >= self._status_us:
            self._status_us = time_us + STATUS_EVERY_US
            self._append(status_message(time_us, _FLYING, setup.system_id))
        if fallback is not self._fallback:
            self._fallback = fallback
            said = (INFO, "the QP is solved again") if fallback is None else (WARNING, f"fallback: {fallback}")
            self.say(time_us, *said)

    def write_snapshot(self, snapshot: Snapshot) -> None:
        """Write a snapshot.

        Raises:
            LogError: It cannot be written.
        """
        if self._recorder is not None:
            self._append(self._recorder.update(snapshot))

    def say(self, time_us: int, severity: int, text: str) -> None:
        """Write a line.

        Raises:
            LogError: It cannot be written.
        """
        self._append(messages.logged_string(time_us, severity, text))

    def flush(self) -> None:
        """Write what waits.

        Raises:
            LogError: It cannot be written.
        """
        waiting = self._samples.take() + self._sensings.take()
        self._append(waiting if self._recorder is None else waiting + self._recorder.take())

    def close(self) -> None:
        """Write what waits, if that can be done, and close."""
        with suppress(LogError):
            self.flush()
        if self._file is not None:
            self._file.close()

    def _append(self, recorded: bytes) -> None:
        if not recorded:
            return
        self._begun().append(recorded)

    def _begun(self) -> SharedLog:
        if self._file is None:
            self._file = SharedLog(self._path, self._beginning)
        return self._file


def _first(references: Horizon) -> tuple[float, ...]:
    """Return position, velocity, acceleration, yaw and its rate of the first reference."""
    position, velocity, acceleration, _, _, yaw, yaw_rate, _ = references
    p, v, a = position.item, velocity.item, acceleration.item
    return (p(0), p(1), p(2), v(0), v(1), v(2), a(0), a(1), a(2), yaw.item(0), yaw_rate.item(0))
