"""Numbered logs of flights, from arming to disarming."""

from contextlib import suppress
from errno import ENOSPC
from typing import NamedTuple

from colibri.mavlink.files.tree import Entry, Files, Names, entries_in

KEPT = 50
WRITE_BYTES = 4096
WRITE_EVERY_US = 1_000_000


class LogNames(NamedTuple):
    """Names of logs: a number of at least so many digits, and a suffix."""

    suffix: str
    digits: int

    def name(self, number: int) -> str:
        return f"{number:0{self.digits}}{self.suffix}"

    def number(self, name: str) -> int:
        """Return the number in a log's name; 0 for another file."""
        number = name.removesuffix(self.suffix)
        return int(number) if name != number and number.isascii() and number.isdigit() else 0


ULOG_NAMES = LogNames(".ulg", 5)


class FlightLog:
    """Writer of logs into a folder; removes the oldest for new ones."""

    def __init__(self, files: Files, folder: Names = (), names: LogNames = ULOG_NAMES, kept: int = KEPT) -> None:
        self._files = files
        self._folder = folder
        self._names = names
        self._kept = kept
        self.name: str | None = None  # of the open file
        self.refusal: int | None = None  # errno of the last write, which ended the log
        self._armed = False
        self._waiting = bytearray()
        self._size = 0
        self._write_at_us = 0

    def record(self, data: bytes) -> None:
        if self.name is not None:
            self._waiting += data

    def update(self, armed: bool, now_us: int) -> None:
        if armed != self._armed:
            self._armed = armed
            if armed:
                self._begin(now_us)
            else:
                self.close()
        elif self._waiting and (len(self._waiting) >= WRITE_BYTES or now_us >= self._write_at_us):
            self._write()
            self._write_at_us = now_us + WRITE_EVERY_US

    def close(self) -> None:
        if self._waiting:
            self._write()
        self.name = None

    def _begin(self, now_us: int) -> None:
        logs = self._logs()
        for log in logs[: max(len(logs) - self._kept + 1, 0)]:
            with suppress(OSError):
                self._files.remove((*self._folder, log.name))
        name = self._names.name(self._names.number(logs[-1].name) + 1 if logs else 1)
        self.name, self.refusal = name, None
        try:
            with suppress(FileExistsError):  # unless a ground station removed it
                self._files.make_folder(self._folder)
            self._files.create((*self._folder, name))
        except OSError as error:
            self.name, self.refusal = None, error.errno
        self._size = 0
        self._waiting.clear()
        self._write_at_us = now_us + WRITE_EVERY_US

    def _write(self) -> None:
        data = bytes(self._waiting)
        self._waiting.clear()
        if self.name is None:
            return
        try:
            self._append((*self._folder, self.name), data)
        except OSError as error:
            self.name, self.refusal = None, error.errno
        self._size += len(data)

    def _append(self, place: Names, data: bytes) -> None:
        """Write at the end of a log; the oldest others give their space."""
        try:
            self._files.write(place, self._size, data)
        except OSError as error:
            logs = self._logs()
            if error.errno != ENOSPC or len(logs) < 2:
                raise
            self._files.remove((*self._folder, logs[0].name))
            self._append(place, data)

    def _logs(self) -> list[Entry]:
        entries, number = entries_in(self._files, self._folder), self._names.number
        return sorted((entry for entry in entries if number(entry.name)), key=lambda entry: number(entry.name))
