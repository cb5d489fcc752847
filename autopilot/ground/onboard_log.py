"""A ULog of each flight for ground stations."""

from collections.abc import Iterable

from colibri.mavlink.files.flight_log import FlightLog
from colibri.mavlink.files.tree import Files
from colibri.mavlink.parameters.store import Parameters
from colibri.mavlink.services.statustext import Line
from colibri.mavlink.telemetry.snapshot import TelemetrySnapshot
from colibri.mavlink.ulog.log import TopicLog
from colibri.mavlink.ulog.recorder import Recorder

LOGS = "logs"


class _Topics(TopicLog):
    """Appends topics to the log of the current flight."""

    def __init__(self, log: FlightLog) -> None:
        super().__init__()
        self._log = log

    def append(self, encoded: bytes) -> None:
        self._log.record(encoded)


class OnboardLog:
    """Records snapshots and status texts while armed."""

    def __init__(self, vehicle: str, system_id: int, parameters: Parameters, files: Files) -> None:
        self._log = FlightLog(files, (LOGS,))
        self._topics = _Topics(self._log)
        self._recorder = Recorder(self._topics, vehicle, system_id, parameters, with_battery=True)
        self._snapshot: TelemetrySnapshot | None = None
        self._armed = False

    @property
    def name(self) -> str | None:
        return self._log.name

    def update(self, snapshot: TelemetrySnapshot | None, said: Iterable[Line], now_us: int, *, armed: bool) -> None:
        begins, ends = armed and not self._armed, self._armed and not armed
        self._armed = armed
        if begins:
            self._log.update(armed, now_us)
            self._log.record(self._recorder.begin())
        log, recorder = self._log, self._recorder
        if log.name is None:
            return
        for line in said:
            recorder.say(now_us, *line)
        if snapshot is not None and snapshot is not self._snapshot:
            recorder.update(snapshot)
        self._snapshot = snapshot
        if ends:
            self._topics.flush()
        log.update(armed, now_us)

    def close(self) -> None:
        self._topics.flush()
        self._log.close()
