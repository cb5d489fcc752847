"""A log file that several processes write to at once: each appends blocks, which the system keeps whole."""

import fcntl
from contextlib import suppress
from pathlib import Path

from colibri.common.process.log_files import LogError, LogFile


class SharedLog(LogFile):
    """A file that goes on while anybody has it open: so an autopilot that was killed goes on in that of its flight."""

    def __init__(self, path: Path, beginning: bytes, *, goes_on: bool = False) -> None:
        """Open the file, its folder made where it is missing, or end the process with one line.

        Args:
            path: Where it is.
            beginning: What is written first, unless somebody has done so.
            goes_on: Whether to append to what nobody has open, too, in place of beginning anew.

        Raises:
            LogError: The beginning cannot be written.
        """
        super().__init__(path, "ab")
        try:
            is_alone = _is_alone(self._file.fileno())
            if is_alone and not goes_on:
                self._file.truncate(0)
            if self._file.seek(0, 2) == 0:
                self.append(beginning)
            _share(self._file.fileno())
        except OSError as error:
            raise LogError(f"cannot write {path}: {error.strerror}") from error


def remove_unused(path: Path) -> None:
    """Remove a shared log of an earlier flight: one that nobody has open."""
    with suppress(OSError), path.open("rb") as file:
        if _is_alone(file.fileno()):
            path.unlink()


def _is_alone(file: int) -> bool:
    """Return whether nobody else has a file open, and let nobody else open it; wait for whoever is about to begin it.

    On a file system without locks nobody can know: then it is not alone.
    """
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        _share(file)
        return False
    except OSError:
        return False
    return True


def _share(file: int) -> None:
    with suppress(OSError):
        fcntl.flock(file, fcntl.LOCK_SH)
