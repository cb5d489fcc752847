"""Numbered logs of flights, from arming to disarming."""

from typing import NamedTuple

from colibri.mavlink.files.tree import Entry, FileRefusal, Files, Names

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
        self.refusal: FileRefusal | None = None  # of the last write, which ended the log
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
            self._files.remove((*self._folder, log.name))
        name = self._names.name(self._names.number(logs[-1].name) + 1 if logs else 1)
        place = (*self._folder, name)
        self.refusal = self._files.create(place)
        if self.refusal is FileRefusal.NOT_FOUND and self._folder:  # a ground station removed it
            self.refusal = self._files.make_folder(self._folder) or self._files.create(place)
        self.name = name if self.refusal is None else None
        self._size = 0
        self._waiting.clear()
        self._write_at_us = now_us + WRITE_EVERY_US

    def _write(self) -> None:
        data = bytes(self._waiting)
        self._waiting.clear()
        if self.name is None:
            return
        place = (*self._folder, self.name)
        refusal = self._files.write(place, self._size, data)
        for log in self._logs()[:-1] if refusal is FileRefusal.NO_SPACE else ():
            self._files.remove((*self._folder, log.name))
            refusal = self._files.write(place, self._size, data)
            if refusal is not FileRefusal.NO_SPACE:
                break
        self._size += len(data)
        if refusal is not None:
            self.refusal = refusal
            self.name = None

    def _logs(self) -> list[Entry]:
        found = self._files.list(self._folder)
        entries = [] if isinstance(found, FileRefusal) else found
        number = self._names.number
        return sorted((entry for entry in entries if number(entry.name)), key=lambda entry: number(entry.name))
