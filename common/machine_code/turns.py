"""Turns of processes at the same work: one does it while the others wait."""

import fcntl
import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGALRM)
_handlers: dict[int, Any] = {}  # of the process, while its signals are held; a mask would not hold other threads'
_held: list[int] = []


class Turn:
    """The right to do some work, by a lock on a file."""

    def __init__(self, file: Path, waiting: Callable[[], object]) -> None:
        self._holds = self._within_another = False
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
        """Deliver signals only at `end`: a callback of C would lose an exception of their handlers."""
        within_another = bool(_handlers)
        try:
            _deliver()
            for number in _SIGNALS:
                if callable(handler := signal.getsignal(number)):
                    signal.signal(number, _hold)
                    _handlers[number] = handler
        except ValueError:
            return  # not the main thread, where handlers run
        self._holds, self._within_another = True, within_another

    def end(self) -> None:
        if self._file is not None:
            os.close(self._file)
            self._file = None
        if self._holds:
            self._holds = False
            if not self._within_another:
                _deliver()


def _hold(number: int, _frame: object) -> None:
    _held.append(number)


def _deliver() -> None:
    """Restore the handlers, and call those of pending signals."""
    for number, handler in _handlers.items():
        signal.signal(number, handler)
    _handlers.clear()
    numbers = [*dict.fromkeys(_held)]
    _held.clear()
    for number in numbers:
        signal.raise_signal(number)
