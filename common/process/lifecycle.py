"""A process's life: one-line errors and exit codes, a clean and quick end, one thread, no pauses."""

import atexit
import gc
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from io import TextIOWrapper
from types import FrameType
from typing import NoReturn

EXIT_FAILED = 1
EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130


def use_one_thread() -> None:
    """Keep linear algebra to one thread: at a dozen states the others only spin, on the cores that the flight needs.

    To be called before numpy is loaded.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("OMP_NUM_THREADS", "1")


def use_safe_path() -> None:
    """Keep the working directory off the path of processes to come: its files, of whatever names, shadow no module."""
    os.environ["PYTHONSAFEPATH"] = "1"


def escape_what_no_stream_encodes() -> None:
    """Have standard output and error escape characters that their encodings lack, in place of an exception."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def nudge_m() -> float:
    """Return how far every flight begins beside its start, m: a test of the tests, 0 unless COLIBRI_NUDGE_M is set."""
    return float(os.environ.get("COLIBRI_NUDGE_M", "0"))


@contextmanager
def loading() -> Iterator[None]:
    """Load modules, or what they are made into, without the garbage collector in between: what is loaded stays."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


@contextmanager
def gc_frozen() -> Iterator[None]:
    """Keep the garbage collector from all that exists already: to look at it again and again costs a flight time.

    What of it is garbage, a thousand objects, stays until the end: to search for it would take 0.15 s of every start.
    What somebody else has frozen, a process that flies many times say, stays frozen, and nothing is added to it.
    """
    ours = not gc.get_freeze_count()
    if ours:
        gc.freeze()
    gc.enable()
    try:
        yield
    finally:
        if ours:
            gc.unfreeze()


def freeze_once() -> None:
    """Freeze what exists at the first call; at each later one collect the garbage of the flights in between.

    For a process in which many flights begin and end: to freeze each one's garbage would keep it for good.
    """
    if gc.get_freeze_count():
        gc.collect()
    else:
        gc.freeze()
    gc.enable()


def end_quickly() -> None:
    """Spare this process at its end the search for garbage through all that it has loaded: a third of a second."""
    atexit.unregister(gc.freeze)
    atexit.register(gc.freeze)


def fail(message: str, code: int = EXIT_BAD_INPUT) -> NoReturn:
    """End the process with one line on standard error."""
    sys.stderr.write(f"colibri: error: {message}\n")
    sys.stderr.flush()
    raise SystemExit(code)


_PARENT_EVERY = 8
"""A process asks at each frame, or ten times a second."""


class Stop:
    """Becomes true when the process shall end: SIGINT, SIGTERM, or (if asked for) the death of its parent."""

    def __init__(self, *, parent: int | None = None, starting: bool = False) -> None:
        """Take over SIGINT and SIGTERM; `starting`: until first asked they end the process at once.

        What is still loading has nothing to put in order, and may load for seconds before it asks. The parent passes
        its id: it may have died before this process could ask.
        """
        self._signalled = False
        self._starting = starting
        self._parent = parent
        self._asked = 0
        signal.signal(signal.SIGINT, self._handle)
        signal.signal(signal.SIGTERM, self._handle)

    def __bool__(self) -> bool:
        """Whether to end now; whether the parent lives is seen every few times."""
        self._starting = False
        self._asked += 1
        if self._parent is not None and self._asked % _PARENT_EVERY == 1 and os.getppid() != self._parent:
            self._signalled = True
        return self._signalled

    def _handle(self, _signal: int, _frame: FrameType | None) -> None:
        if self._starting:
            os._exit(EXIT_INTERRUPTED)
        self._signalled = True
