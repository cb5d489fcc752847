"""A log of each flight for ground stations, as ULog or DataFlash."""

from collections.abc import Callable, Iterable
from typing import NamedTuple

from colibri.mavlink.dataflash.recorder import DataFlashRecorder
from colibri.mavlink.files.flight_log import ULOG_NAMES, FlightLog, LogNames
from colibri.mavlink.files.tree import Files
from colibri.mavlink.parameters.store import Parameters
from colibri.mavlink.services.statustext import Line
from colibri.mavlink.telemetry.snapshot import TelemetrySnapshot
from colibri.mavlink.ulog.log import TopicLog
from colibri.mavlink.ulog.recorder import Recorder

LOGS = "logs"
Write = Callable[[bytes], None]
FlightRecorder = Recorder | DataFlashRecorder


class LoggedVehicle(NamedTuple):
    """What a log says of its vehicle."""

    name: str
    system_id: int
    parameters: Parameters
    banner: str = ""  # program and version, by which readers of DataFlash know the vehicle
    boot_unix_us: int = 0  # Unix time at simulated time 0; 0 if unknown


class LogFormat(NamedTuple):
    """Format of the logs, and numbers as their readers expect them."""

    names: LogNames
    first_id: int  # of LOG_ENTRY
    recorder: Callable[[LoggedVehicle, Write], FlightRecorder]


ULOG = LogFormat(
    ULOG_NAMES, 0, lambda it, write: Recorder(TopicLog(write), it.name, it.system_id, it.parameters, with_battery=True)
)
DATAFLASH = LogFormat(
    LogNames(".BIN", 8), 1, lambda it, write: DataFlashRecorder(write, it.parameters, it.banner, it.boot_unix_us)
)


class OnboardLog:
    """Records snapshots and status texts while armed."""

    def __init__(self, vehicle: LoggedVehicle, files: Files, form: LogFormat = ULOG) -> None:
        self._log = FlightLog(files, (LOGS,), form.names)
        self._recorder = form.recorder(vehicle, self._log.record)
        self._snapshot: TelemetrySnapshot | None = None
        self._armed = False

    @property
    def name(self) -> str | None:
        return self._log.name

    def update(self, snapshot: TelemetrySnapshot | None, said: Iterable[Line], now_us: int, *, armed: bool) -> None:
        begins, ends = armed and not self._armed, self._armed and not armed
        self._armed = armed
        log, recorder = self._log, self._recorder
        if begins:
            log.update(armed, now_us)
            log.record(recorder.begin())
        if log.name is None:
            return
        for line in said:
            recorder.say(now_us, *line)
        if snapshot is not None and snapshot is not self._snapshot:
            recorder.update(snapshot)
        self._snapshot = snapshot
        if ends:
            recorder.flush()
        log.update(armed, now_us)

    def close(self) -> None:
        self._recorder.flush()
        self._log.close()
