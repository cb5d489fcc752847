"""Exclusive locks on folders."""

import fcntl
import os
from pathlib import Path

from colibri.common.errors import Error


class FolderInUseError(Error):
    """The folder is locked by another process."""


class FolderLock:
    """An exclusive lock on a folder until the end of the process."""

    def __init__(self, folder: Path, option: str) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder: int | None = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            fcntl.flock(self._folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self.close()
            raise FolderInUseError(f"{option} {folder} is in use by another flight: end that or name another") from None
        except OSError:
            return  # a file system without locks

    def close(self) -> None:
        if self._folder is not None:
            os.close(self._folder)
            self._folder = None

    def __enter__(self) -> "FolderLock":
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()
