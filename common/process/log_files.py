"""Log files: rows of numbers, lines of JSON, frames; to the disk as they come, or block by block."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from contextlib import suppress
from itertools import accumulate
from math import inf
from pathlib import Path
from typing import Generic, Literal, TypeVar

import msgspec

from colibri.common.errors import InFlightError
from colibri.common.process.lifecycle import fail

_NUMBERS = msgspec.json.Encoder(enc_hook=float)
"""The shortest digits that keep every bit, as `str` has them, in a tenth of its time; but no word for nan and inf."""
_NULL = b"null"
"""What nan and inf are encoded as, which have no word there."""


class LogError(InFlightError):
    """A log that cannot be written any further; the message names its file."""


def set_aside(*paths: Path) -> None:
    """Give logs that are over a name of their own, so that others can begin: plant.csv becomes plant-1.csv.

    All get the same number, the first that none of them has had; what is not there is passed over.

    Raises:
        LogError: One cannot be renamed.
    """
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
    """A file of records, each of which gets into it whole or not at all, in their order."""

    def __init__(self, path: Path, how: Literal["wb", "ab"] = "wb") -> None:
        """Open the file, its folder made where it is missing, or end the process with one line."""
        self._path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open(how, buffering=0)
        except OSError as error:
            fail(f"cannot write {path}: {error.strerror}")

    def append(self, *records: bytes) -> None:
        """Append records, which reach the system at once; nothing once that has failed.

        Raises:
            LogError: They cannot be written, the disk being full, say; the file holds those that were.
        """
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
        """Close."""
        self._file.close()


_Record = TypeVar("_Record")


class BlockLog(LogFile, ABC, Generic[_Record]):
    """A file whose records are written `BLOCK` at a time: a process that is killed loses those since the last block.

    Each is formatted as it comes: of a whole block that would take longer than the other process computes.
    """

    BLOCK = 64

    def __init__(self, path: Path) -> None:
        """Open the file, its folder made where it is missing, or end the process with one line."""
        super().__init__(path)
        self._waiting: list[bytes] = []

    def add(self, record: _Record) -> None:
        """Append a record, and write all that wait once they are a block.

        Raises:
            LogError: They cannot be written.
        """
        self._waiting.append(self.encode(record))
        if len(self._waiting) >= self.BLOCK:
            self.flush()

    def flush(self) -> None:
        """Write what waits.

        Raises:
            LogError: It cannot be written.
        """
        waiting, self._waiting = self._waiting, []
        if waiting:
            self.append(*waiting)

    def close(self) -> None:
        """Write what waits, if that can be done, and close: who must know whether it can flushes before."""
        with suppress(LogError):
            self.flush()
        super().close()

    @abstractmethod
    def encode(self, record: _Record) -> bytes:
        """Return the bytes of a record."""


class CsvLog(BlockLog[Sequence[float]]):
    """A CSV file written block by block; numbers keep every bit."""

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        """Create the file and its header, or end the process with one line."""
        super().__init__(path)
        try:
            self.append((",".join(columns) + "\n").encode())
        except LogError as error:
            fail(str(error))

    def encode(self, record: Sequence[float]) -> bytes:
        """Return the line of a row."""
        line = _NUMBERS.encode(record)[1:-1]
        if _NULL[:1] not in line:  # no number has that letter
            return line + b"\n"
        if inf in record or -inf in record:
            return ",".join(map(str, record)).encode() + b"\n"
        return line.replace(_NULL, b"nan") + b"\n"
