"""Turns of processes at the same work: one does it while the others wait, and no signal interrupts it."""

import fcntl
import os
import signal
from collections.abc import Callable
from pathlib import Path

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGALRM)


class Turn:
    """The right to do some work, by a lock on a file, until `end` or the end of the process."""

    def __init__(self, file: Path, waiting: Callable[[], object]) -> None:
        self._before: set[int] | None = None
        self._file: int | None = None
        try:
            self._file = os.open(file, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                waiting()
                fcntl.flock(self._file, fcntl.LOCK_EX)
        except OSError:
            return  # a file system without locks, or a folder of another user
        except BaseException:
            self.end()
            raise

    def hold_signals(self) -> None:
        """Deliver signals until `end` only: an exception of their handlers would be lost in a callback of C."""
        handled = {number for number in _SIGNALS if callable(signal.getsignal(number))}
        before = signal.pthread_sigmask(signal.SIG_UNBLOCK, handled)  # what an outer turn has held is delivered here
        signal.pthread_sigmask(signal.SIG_BLOCK, handled)
        self._before = {int(number) for number in before}

    def end(self) -> None:
        if self._file is not None:
            os.close(self._file)
            self._file = None
        if self._before is not None:
            before, self._before = self._before, None
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
