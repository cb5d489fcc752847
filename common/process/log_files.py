"""Log files: rows of numbers, lines of JSON, to the disk as they come."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import msgspec

from colibri.common.errors import InFlightError
from colibri.common.process.lifecycle import fail

_NUMBERS = msgspec.json.Encoder(enc_hook=float)
"""The shortest digits that keep every bit, as `str` has them, in a tenth of its time; but no word for nan and inf."""


class LogError(InFlightError):
    """A log that cannot be written any further; the message names its file."""


class LogFile:
    """A file each of whose records reaches the system, whole or not at all, before the next."""

    def __init__(self, path: Path, how: Literal["wb", "ab"] = "wb") -> None:
        """Open the file, its folder made where it is missing, or end the process with one line."""
        self._path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open(how, buffering=0)
        except OSError as error:
            fail(f"cannot write {path}: {error.strerror}")

    def append(self, record: bytes) -> None:
        """Append a record; nothing once that has failed.

        Raises:
            LogError: The record cannot be written, the disk being full, say; the file holds all those before it.
        """
        if self._file.closed:
            return
        written = 0
        try:
            while written < len(record):
                written += self._file.write(record[written:])
        except OSError as error:
            self._file.truncate(self._file.tell() - written)
            self._file.close()
            raise LogError(f"cannot go on writing {self._path}: {error.strerror}") from error

    def close(self) -> None:
        """Close."""
        self._file.close()


class CsvLog(LogFile):
    """A CSV file written row by row, so that no end of the process loses one; numbers keep every bit."""

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        """Create the file and its header, or end the process with one line."""
        super().__init__(path)
        try:
            self.append((",".join(columns) + "\n").encode())
        except LogError as error:
            fail(str(error))

    def write(self, row: Sequence[float]) -> None:
        """Append a row.

        Raises:
            LogError: It cannot be written.
        """
        line = _NUMBERS.encode(row)[1:-1]
        if b"null" in line:
            line = ",".join(map(str, row)).encode()
        self.append(line + b"\n")
