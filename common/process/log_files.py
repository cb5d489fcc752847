"""Log files: records that are written whole, as they come or block by block."""

from contextlib import suppress
from itertools import accumulate
from pathlib import Path
from typing import Literal

from colibri.common.errors import InFlightError
from colibri.common.process.lifecycle import fail


class LogError(InFlightError):
    """A log that cannot be written any further; the message names its file."""


def set_aside(*paths: Path) -> None:
    """Give logs that are over a name of their own, so that others can begin: flight.ulg becomes flight-1.ulg.

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


class BlockLog(LogFile):
    """A file whose records are written `BLOCK` at a time: a process that is killed loses those since the last block."""

    BLOCK = 64

    def __init__(self, path: Path) -> None:
        """Open the file, its folder made where it is missing, or end the process with one line."""
        super().__init__(path)
        self._waiting: list[bytes] = []

    def add(self, record: bytes) -> None:
        """Append a record, and write all that wait once they are a block.

        Raises:
            LogError: They cannot be written.
        """
        self._waiting.append(record)
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
