"""Log files: rows of numbers, lines of JSON, to the disk as they come."""

from collections.abc import Sequence
from io import FileIO
from pathlib import Path
from typing import Literal

import msgspec

from colibri.common.process.lifecycle import fail

_NUMBERS = msgspec.json.Encoder(enc_hook=float)
"""The shortest digits that keep every bit, as `str` has them, in a tenth of its time; but no word for nan and inf."""


class CsvLog:
    """A CSV file written row by row, so that no end of the process loses one; numbers keep every bit."""

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        """Create the file and its header."""
        self._file = open_for_writing(path)
        self._file.write((",".join(columns) + "\n").encode())

    def write(self, row: Sequence[float]) -> None:
        """Append a row."""
        line = _NUMBERS.encode(row)[1:-1]
        if b"null" in line:
            line = ",".join(map(str, row)).encode()
        self._file.write(line + b"\n")

    def close(self) -> None:
        """Close."""
        self._file.close()


def open_for_writing(path: Path, how: Literal["wb", "ab"] = "wb") -> FileIO:
    """Open a file whose every write reaches the system, its folder made where it is missing, or end with one line."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return path.open(how, buffering=0)
    except OSError as error:
        fail(f"cannot write {path}: {error.strerror}")
