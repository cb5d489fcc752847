"""The log that ground stations list and download: a ULog of each flight, from arming to disarming."""

from collections.abc import Iterable

from colibri.mavlink.files.flight_log import FlightLog
from colibri.mavlink.files.tree import Files
from colibri.mavlink.services.statustext import Line
from colibri.mavlink.telemetry.snapshot import Snapshot
from colibri.mavlink.ulog.recorder import Recorder

LOGS = "logs"
SAMPLE_EVERY_US = 40_000
"""A log must come over a radio, and several fit into memory: PX4's, too, have fewer samples than the control loop."""


class OnboardLog:
    """Records snapshots and status texts while the rotors are armed."""

    def __init__(self, recorder: Recorder, files: Files) -> None:
        self._recorder = recorder
        self._log = FlightLog(files, (LOGS,))
        self._snapshot: Snapshot | None = None
        self._armed = False

    @property
    def name(self) -> str | None:
        """Name of the log that is being written."""
        return self._log.name

    def update(self, snapshot: Snapshot | None, said: Iterable[Line], now_us: int, *, armed: bool) -> None:
        """Record a snapshot, if it is new, and what was said since the last time; begin and end logs."""
        begins, ends = armed and not self._armed, self._armed and not armed
        self._armed = armed
        if begins:
            self._log.update(armed, now_us)
            self._log.record(self._recorder.begin())
        log, recorder = self._log, self._recorder
        if log.name is None:
            return
        for line in said:
            log.record(recorder.say(now_us, *line))
        if snapshot is not None and snapshot is not self._snapshot:
            log.record(recorder.update(snapshot))
        self._snapshot = snapshot
        if ends:
            log.record(recorder.take())
        log.update(armed, now_us)

    def close(self) -> None:
        """Close the log."""
        self._log.record(self._recorder.take())
        self._log.close()
