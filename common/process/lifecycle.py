"""Process life cycle: errors, exit codes, quick end, one thread, no garbage-collection pauses."""

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
    """Limit linear algebra, before numpy is loaded: at a dozen states further threads only take cores."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("OMP_NUM_THREADS", "1")


def use_safe_path() -> None:
    """Keep the working directory, with possible namesakes, off the module path of child processes."""
    os.environ["PYTHONSAFEPATH"] = "1"


def escape_what_no_stream_encodes() -> None:
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def nudge_m() -> float:
    """Return the offset of every flight's start, m: COLIBRI_NUDGE_M, which tests the tests."""
    return float(os.environ.get("COLIBRI_NUDGE_M", "0"))


@contextmanager
def loading() -> Iterator[None]:
    """Load modules without garbage collection: loaded objects stay."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


@contextmanager
def gc_frozen() -> Iterator[None]:
    """Exclude all existing objects from garbage collection, to save flight time.

    Collecting their garbage would add 0.15 s to every start.
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
    """Freeze all objects at the first call; later calls collect the garbage of previous flights."""
    if gc.get_freeze_count():
        gc.collect()
    else:
        gc.freeze()
    gc.enable()


def end_quickly() -> None:
    """Skip the final garbage collection, a third of a second."""
    atexit.unregister(gc.freeze)
    atexit.register(gc.freeze)


def fail(message: str, code: int = EXIT_BAD_INPUT) -> NoReturn:
    sys.stderr.write(f"colibri: error: {message}\n")
    sys.stderr.flush()
    raise SystemExit(code)


_PARENT_EVERY = 8
"""Checks between two looks at the parent; a process checks every frame, or ten times a second."""


class Stop:
    """True once the process should end: on SIGINT, SIGTERM, or the parent's death."""

    def __init__(self, *, parent: int | None = None, starting: bool = False) -> None:
        """Handle signals; with `starting` they end the process at once until the first check.

        The parent passes its own id: it may die before this process reads it.
        """
        self._signalled = False
        self._starting = starting
        self._parent = parent
        self._asked = 0
        signal.signal(signal.SIGINT, self._handle)
        signal.signal(signal.SIGTERM, self._handle)

    def __bool__(self) -> bool:
        self._starting = False
        self._asked += 1
        if self._parent is not None and self._asked % _PARENT_EVERY == 1 and os.getppid() != self._parent:
            self._signalled = True
        return self._signalled

    def _handle(self, _signal: int, _frame: FrameType | None) -> None:
        if self._starting:
            os._exit(EXIT_INTERRUPTED)
        self._signalled = True
