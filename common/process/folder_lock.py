"""Folders that one process at a time writes to."""

import fcntl
import os
from pathlib import Path

from colibri.common.errors import Error


class FolderInUseError(Error):
    """Another process writes to a folder; the message names it."""


class FolderLock:
    """Keeps a folder for whoever holds this, and leaves nothing in it; the system releases it with the process."""

    def __init__(self, folder: Path, option: str) -> None:
        """Lock `folder`, made where it is missing; errors name the `option` that it was given by.

        Raises:
            FolderInUseError: Somebody else holds it.
            OSError: It cannot be made or read.
        """
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
        """Release the folder."""
        if self._folder is not None:
            os.close(self._folder)
            self._folder = None

    def __enter__(self) -> "FolderLock":
        """Hold it."""
        return self

    def __exit__(self, *_error: object) -> None:
        """Release it."""
        self.close()
