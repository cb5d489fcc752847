"""Locks that the system releases with the process that holds them, however it ends."""

import fcntl
import os
from pathlib import Path
from typing import Self


class FileLock:
    """Keeps a file for one process at a time."""

    def __init__(self, path: Path) -> None:
        """Lock `path`, a folder or a file, when that is asked for; a file is made where it is missing."""
        self._path = path
        self._file: int | None = None

    def acquire(self, *, wait: bool = True) -> bool:
        """Take it; return whether that worked, which it always does for one who waits."""
        how = os.O_RDONLY if self._path.is_dir() else os.O_RDWR | os.O_CREAT
        opened = os.open(self._path, how | os.O_CLOEXEC, 0o666)
        try:
            fcntl.flock(opened, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            os.close(opened)
            return False
        self._file = opened
        return True

    def release(self) -> None:
        """Leave it to others."""
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def __enter__(self) -> Self:
        """Wait for it."""
        self.acquire()
        return self

    def __exit__(self, *_error: object) -> None:
        """Release it."""
        self.release()


class JournalLock(FileLock):
    """Keeps a journal for whoever writes to it, which then ends with a whole line."""

    def __init__(self, journal: Path) -> None:
        """Keep `journal` by a file beside it."""
        super().__init__(journal.with_name(f"{journal.name}.lock"))
        self._journal = journal

    def acquire(self, *, wait: bool = True) -> bool:
        """Take it, and cut off a last line that a process did not live to write."""
        taken = super().acquire(wait=wait)
        if taken:
            _cut_off(self._journal)
        return taken


def _cut_off(journal: Path) -> None:
    with journal.open("r+b") as file:
        end = file.seek(0, os.SEEK_END)
        if end:
            file.seek(end - 1)
            if file.read(1) != b"\n":
                file.seek(0)
                file.truncate(file.read().rfind(b"\n") + 1)
