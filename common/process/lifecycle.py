"""Process life cycle: errors, exit codes, quick end, garbage collection."""

import atexit
import gc
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import NoReturn

from colibri.common.errors import Error, shown

EXIT_FAILED = 1
EXIT_BAD_INPUT = 2
_LONGEST_MESSAGE = 2000
_MOST_NUDGE_M = 100.0
_frozen_once = False  # is quicker than gc.get_freeze_count(), which counts objects: 20 ms in a run of many tests


def use_one_thread() -> None:
    """Limit linear algebra to one thread, before numpy is loaded."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("OMP_NUM_THREADS", "1")


def nudge_m() -> float:
    """Return the offset of every flight's start, m: COLIBRI_NUDGE_M, which tests the tests."""
    text = os.environ.get("COLIBRI_NUDGE_M", "0")
    try:
        if abs(offset_m := float(text)) <= _MOST_NUDGE_M:
            return offset_m
    except ValueError:
        pass
    raise Error(f'COLIBRI_NUDGE_M must be a number from -{_MOST_NUDGE_M:g} to {_MOST_NUDGE_M:g}, not "{shown(text)}"')


@contextmanager
def loading() -> Iterator[None]:
    """Load modules without garbage collection: loaded objects stay, so they count as old at once."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            if not (_frozen_once or gc.get_freeze_count()):
                gc.freeze()
                gc.unfreeze()
            gc.enable()


@contextmanager
def gc_frozen() -> Iterator[None]:
    """Exclude all existing objects from garbage collection, to save flight time."""
    ours = not (_frozen_once or gc.get_freeze_count())
    if ours:
        gc.freeze()
    gc.enable()
    try:
        yield
    finally:
        if ours:
            gc.unfreeze()


def freeze_once() -> None:
    """Freeze all objects at the first call; later calls collect garbage."""
    global _frozen_once
    (gc.collect if _frozen_once or gc.get_freeze_count() else gc.freeze)()
    _frozen_once = True
    gc.enable()


def end_quickly() -> None:
    """Skip the final garbage collection, a third of a second."""
    atexit.unregister(gc.freeze)
    atexit.register(gc.freeze)


def fail(message: str, code: int = EXIT_BAD_INPUT) -> NoReturn:
    with suppress(OSError):
        sys.stderr.write(f"colibri: error: {shown(message, _LONGEST_MESSAGE)}\n")
        sys.stderr.flush()
    raise SystemExit(code)


_PARENT_EVERY = 8  # checks between two looks at the parent; a process checks every frame, or ten times a second
_LAST_S = 5  # a process whose parent has died is killed after this time, wherever it hangs
_PR_SET_PDEATHSIG = 1
ENDINGS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def handle_endings(handler: Callable[[int, FrameType | None], object] | signal.Handlers) -> None:
    """Handle Ctrl-C, `kill` and a closed terminal, unless under `nohup`."""
    for number in ENDINGS:
        if number is not signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler)


def interrupt(number: int, _frame: FrameType | None = None) -> NoReturn:
    raise KeyboardInterrupt(number)


def fail_interrupted(interrupt: KeyboardInterrupt, kept: str = "") -> NoReturn:
    """End with a line, and 128 plus the signal's number."""
    number = interrupt.args[0] if interrupt.args else signal.SIGINT
    how = "interrupted" if number == signal.SIGINT else f"ended by {signal.Signals(number).name}"
    fail(how + kept, 128 + number)


@contextmanager
def one_line(code: int = EXIT_BAD_INPUT, kept: str = "") -> Iterator[None]:
    """End with one line on an `Error`, and on an interruption if there is something `kept`."""
    try:
        yield
    except Error as error:
        fail(str(error), code)
    except KeyboardInterrupt as ended:
        if not kept:
            raise
        fail_interrupted(ended, kept)


def end_with(parent: int) -> None:
    """End this process with its parent. Call it before anything can block."""

    def look(*_signal: object) -> None:
        if os.getppid() != parent:
            os._exit(128 + signal.SIGHUP)

    signal.signal(signal.SIGALRM, look)
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGALRM)
    else:
        signal.setitimer(signal.ITIMER_REAL, 1.0, 1.0)
    look()


class Stop:
    """True once the process should end: on SIGINT, SIGTERM, SIGHUP, or the parent's death."""

    def __init__(self, *, parent: int | None = None, starting: bool = False) -> None:
        """Handle signals; with `starting` they end the process at once until the first check."""
        self.code = 0
        self._starting = starting
        self._parent = parent
        self._asked = 0
        handle_endings(self._handle)
        if parent is not None:
            signal.signal(signal.SIGALRM, self._look_at_parent)
            self._look_at_parent()

    def __bool__(self) -> bool:
        self._starting = False
        self._asked += 1
        if self._asked % _PARENT_EVERY == 1:
            self._look_at_parent()
        return self.code != 0

    def _look_at_parent(self, *_signal: object) -> None:
        if self._parent is not None and os.getppid() != self._parent:
            self._parent = None
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            signal.alarm(_LAST_S)
            self._handle(signal.SIGHUP)

    def _handle(self, number: int, _frame: FrameType | None = None) -> None:
        self.code = self.code or 128 + number
        if self._starting:
            os._exit(self.code)
