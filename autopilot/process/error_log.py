"""Exceptions caught in flight, as lines of JSON."""

import sys
from pathlib import Path

import msgspec

from colibri.autopilot.core.defence.errors import ErrorRecord
from colibri.common.files import regular
from colibri.common.process.status import Status

FILE = "errors.jsonl"


class ErrorLog:
    def __init__(self, folder: Path | None, status: Status) -> None:
        self._path = None if folder is None else folder / FILE
        self._status = status
        self._said: set[str] = set()
        self.failed = False

    def write(self, records: list[ErrorRecord]) -> None:
        for record in records:
            self.failed = True
            kept = self._kept(record)
            if record.part not in self._said:
                self._said.add(record.part)
                where = f"; traceback in {self._path}" if kept else ""
                self._status.say("error", f"{record.part} failed ({record.error}): {record.instead}{where}")

    def _kept(self, record: ErrorRecord) -> bool:
        if self._path is not None:
            try:
                with open(self._path, "ab", opener=regular) as file:
                    file.write(msgspec.json.encode(record) + b"\n")
                return True
            except OSError:
                pass
        sys.stderr.write(record.traceback)
        return False
