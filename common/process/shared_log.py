"""A log file with several concurrent writers; appended blocks stay whole."""

import fcntl
from contextlib import suppress
from pathlib import Path

from colibri.common.files import regular
from colibri.common.process.log_files import LogError, LogFile


class SharedLog(LogFile):
    """A log that continues while any process has it open."""

    def __init__(self, path: Path, beginning: bytes, *, goes_on: bool = False) -> None:
        """Open the file; write `beginning` if it is new; `goes_on` keeps the content."""
        super().__init__(path, "ab")
        try:
            is_alone = _is_alone(self._file.fileno())
            if is_alone and not goes_on:
                self._file.truncate(0)
            if self._file.seek(0, 2) == 0:
                self.append(beginning)
            share(self._file.fileno())
        except OSError as error:
            raise LogError(f"cannot write {path}: {error.strerror}") from error


def remove_unused(path: Path) -> None:
    with suppress(OSError), open(path, "rb", opener=regular) as file:
        if _is_alone(file.fileno()):
            path.unlink()


def _is_alone(file: int) -> bool:
    """Lock others out if the file is open here only; `False` without file locks."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        share(file)
        return False
    except OSError:
        return False
    return True


def share(file: int) -> None:
    with suppress(OSError):
        fcntl.flock(file, fcntl.LOCK_SH)
