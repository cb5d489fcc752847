"""File locks that the system releases when their process ends."""

import fcntl
import os
from pathlib import Path
from typing import Self

from colibri.common.files import regular


class FileLock:
    """An exclusive lock on a folder or a file, which is created if missing."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: int | None = None

    def acquire(self, *, wait: bool = True) -> bool:
        how = os.O_RDONLY if self._path.is_dir() else os.O_RDWR | os.O_CREAT
        opened = os.open(self._path, how | os.O_NONBLOCK | os.O_CLOEXEC, 0o666)
        try:
            fcntl.flock(opened, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            os.close(opened)
            return False
        self._file = opened
        return True

    def release(self) -> None:
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def __enter__(self) -> Self:
        self.acquire()
        return self

    def __exit__(self, *_error: object) -> None:
        self.release()


class JournalLock(FileLock):
    """A writer's lock on a journal; removes the incomplete last line of a dead one."""

    def __init__(self, journal: Path) -> None:
        super().__init__(journal.with_name(f"{journal.name}.lock"))
        self._journal = journal

    def acquire(self, *, wait: bool = True) -> bool:
        taken = super().acquire(wait=wait)
        if taken:
            _cut_off(self._journal)
        return taken


def _cut_off(journal: Path) -> None:
    with open(journal, "r+b", opener=regular) as file:
        end = file.seek(0, os.SEEK_END)
        if end:
            file.seek(end - 1)
            if file.read(1) != b"\n":
                file.seek(0)
                file.truncate(file.read().rfind(b"\n") + 1)
