"""Log files of whole records, written immediately or in blocks."""

from contextlib import suppress
from itertools import accumulate
from pathlib import Path
from typing import Literal

from colibri.common.errors import InFlightError
from colibri.common.files import regular
from colibri.common.process.lifecycle import fail


class LogError(InFlightError):
    """A log can no longer be written."""


def set_aside(*paths: Path) -> None:
    """Rename finished logs, with one number for all: flight.ulg becomes flight-1.ulg."""
    number = 1
    while any(_numbered(path, number).exists() for path in paths):
        number += 1
    for path in filter(Path.exists, paths):
        try:
            path.rename(_numbered(path, number))
        except OSError as error:
            raise LogError(f"cannot rename {path}: {error.strerror}") from error


def _numbered(path: Path, number: int) -> Path:
    return path.with_stem(f"{path.stem}-{number}")


class LogFile:
    """A file of records, each written whole or not at all, in order."""

    def __init__(self, path: Path, how: Literal["wb", "ab"] = "wb") -> None:
        self._path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = open(path, how, buffering=0, opener=regular)  # noqa: SIM115
        except OSError as error:
            fail(f"cannot write {path}: {error.strerror}")

    def append(self, *records: bytes) -> None:
        """Append records at once, ignored after a failure; raise `LogError` if the disk is full."""
        if self._file.closed:
            return
        block, written = b"".join(records), 0
        try:
            while written < len(block):
                written += self._file.write(block[written:])
        except OSError as error:
            whole = max(end for end in accumulate(map(len, records), initial=0) if end <= written)
            self._file.truncate(self._file.tell() - written + whole)
            self._file.close()
            raise LogError(f"cannot go on writing {self._path}: {error.strerror}") from error

    def close(self) -> None:
        self._file.close()


class BlockLog(LogFile):
    """A file written `BLOCK` records at a time: a killed process loses the last ones."""

    BLOCK = 64

    def __init__(self, path: Path, how: Literal["wb", "ab"] = "wb") -> None:
        super().__init__(path, how)
        self._waiting: list[bytes] = []

    def add(self, record: bytes) -> None:
        self._waiting.append(record)
        if len(self._waiting) >= self.BLOCK:
            self.flush()

    def flush(self) -> None:
        waiting, self._waiting = self._waiting, []
        if waiting:
            self.append(*waiting)

    def close(self) -> None:
        """Write pending records if possible, and close; `flush` first to detect failure."""
        with suppress(LogError):
            self.flush()
        super().close()
