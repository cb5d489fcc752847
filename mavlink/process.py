"""What both processes share with the world: one-line errors, a clean end on a signal, status lines, log files."""

import argparse
import gc
import json
import os
import re
import signal
import sys
from argparse import ArgumentTypeError
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from io import FileIO
from math import inf, isfinite
from pathlib import Path
from types import FrameType
from typing import Any, Literal, NoReturn, TypeVar

import msgspec

from mavlink.link import LinkError
from mavlink.tlog import STAMP

EXIT_FAILED = 1
EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130
LAST_SYSTEM_ID = 255

Link = TypeVar("Link")

_NUMBERS = msgspec.json.Encoder(enc_hook=float)
"""The shortest digits that keep every bit, as `str` has them, in a tenth of its time; but no word for nan and inf."""


class ArgumentParser(argparse.ArgumentParser):
    """A parser whose errors are one line and exit code 2, and to which what begins like `-33.9,` is a value."""

    def __init__(self, *args: Any, **options: Any) -> None:
        """Take what argparse takes."""
        super().__init__(*args, **options)
        self._negative_number_matcher = re.compile(r"^-\.?\d")

    def error(self, message: str) -> NoReturn:
        """Say what is wrong and where to read on."""
        fail(f"{message} (see {self.prog} --help)")


def use_one_thread() -> None:
    """Keep linear algebra to one thread: at a dozen states the others only spin, on the cores that the flight needs.

    To be called before numpy is loaded.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("OMP_NUM_THREADS", "1")


def nudge_m() -> float:
    """Return how far every flight begins beside its start, m: a test of the tests, 0 unless COLIBRI_NUDGE_M is set."""
    return float(os.environ.get("COLIBRI_NUDGE_M", "0"))


@contextmanager
def undisturbed() -> Iterator[None]:
    """Keep the garbage collector from all that exists already: to look at it again and again costs a flight time."""
    gc.collect()
    gc.freeze()
    gc.enable()
    try:
        yield
    finally:
        gc.unfreeze()


def number(text: str) -> float:
    """Read a finite number of the command line."""
    value = float(text)
    if not isfinite(value):
        raise ValueError
    return value


def positive(text: str) -> float:
    """Read a number above zero of the command line."""
    value = number(text)
    if value <= 0.0:
        raise ArgumentTypeError(f"must be above zero, not {text}")
    return value


def natural(text: str) -> int:
    """Read a whole number from 0 on of the command line."""
    value = int(text)
    if value < 0:
        raise ArgumentTypeError(f"must not be below zero, not {text}")
    return value


def system_id(text: str) -> int:
    """Read a MAVLink system id of the command line."""
    value = int(text)
    if not 1 <= value <= LAST_SYSTEM_ID:
        raise ArgumentTypeError(f"must be from 1 to {LAST_SYSTEM_ID}, not {text}")
    return value


def speed(text: str) -> float:
    """Read how many times real time to fly: a number above zero, or `max`."""
    return inf if text == "max" else positive(text)


def fail(message: str, code: int = EXIT_BAD_INPUT) -> NoReturn:
    """End the process with one line on standard error."""
    sys.stderr.write(f"colibri: error: {message}\n")
    sys.stderr.flush()
    raise SystemExit(code)


class Stop:
    """Becomes true when the process shall end: SIGINT, SIGTERM, or (if asked for) the death of its parent."""

    def __init__(self, *, parent: int | None = None, starting: bool = False) -> None:
        """Take over SIGINT and SIGTERM; `starting`: until first asked they end the process at once.

        What is still loading has nothing to put in order, and may load for seconds before it asks. The parent says who
        it is: it may have died before this process could ask.
        """
        self._signalled = False
        self._starting = starting
        self._parent = parent
        signal.signal(signal.SIGINT, self._handle)
        signal.signal(signal.SIGTERM, self._handle)

    def __bool__(self) -> bool:
        """Whether to end now."""
        self._starting = False
        return self._signalled or (self._parent is not None and os.getppid() != self._parent)

    def _handle(self, _signal: int, _frame: FrameType | None) -> None:
        if self._starting:
            os._exit(EXIT_INTERRUPTED)
        self._signalled = True


class Status:
    """Tells what the process is doing: lines for a person on standard error, or JSON lines on standard output."""

    def __init__(self, name: str, *, as_json: bool) -> None:
        """Speak as `name`."""
        self._name = name
        self.as_json = as_json

    def say(self, event: str, text: str, **facts: Any) -> None:
        """Report `event`: `text` for a person, `facts` for a program."""
        if self.as_json:
            sys.stdout.write(json.dumps({"event": event, "text": text, **facts}) + "\n")
            sys.stdout.flush()
        else:
            sys.stderr.write(f"{self._name}: {text}\n")
            sys.stderr.flush()


def add_common_arguments(parser: ArgumentParser, log: str) -> None:
    """Add the options that both processes have; `log` names what `--out` writes."""
    add = parser.add_argument
    add("--system-id", type=system_id, default=1, metavar="ID", help="MAVLink system (default 1)")
    add("--out", type=Path, metavar="DIR", help=f"write {log} there")
    add("--json", action="store_true", help="status as JSON lines on standard output")
    add("--parent", type=natural, metavar="PID", help="end when that process, which started this one, ends")


def begin(name: str, url: str, args: argparse.Namespace, opened: Callable[[str], Link]) -> tuple[Link, Status, Stop]:
    """Open the link at `url` by `opened` and take over signals, or end with one line.

    To be called before numpy is loaded.
    """
    use_one_thread()
    gc.disable()  # until all is loaded, see `undisturbed`: what is loaded stays
    stop = Stop(parent=args.parent, starting=True)
    try:
        link = opened(url)
    except LinkError as error:
        fail(str(error))
    return link, Status(name, as_json=args.json), stop


class Progress:
    """Reports how far a flight is, often to a program and seldom to a person."""

    def __init__(self, status: Status) -> None:
        """Report through `status`."""
        self._status = status
        self._every_s = 0.1 if status.as_json else 2.0
        self._due_s = self._every_s

    def report(self, sim_time_s: float, wall_time_s: float) -> None:
        """Report, if it is time to."""
        if wall_time_s < self._due_s:
            return
        self._due_s = wall_time_s + self._every_s
        text = f"t = {sim_time_s:.1f} s, {sim_time_s / wall_time_s:.0f} times real time"
        self._status.say("progress", text, sim_time_s=sim_time_s, wall_time_s=wall_time_s)


class CsvLog:
    """A CSV file written row by row, so that no end of the process loses one; numbers keep every bit."""

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        """Create the file and its header."""
        self._file = _open_for_writing(path)
        self._file.write((",".join(columns) + "\n").encode())

    def write(self, row: Sequence[float]) -> None:
        """Append a row."""
        line = _NUMBERS.encode(row)[1:-1]
        if b"null" in line:
            line = ",".join(map(str, row)).encode()
        self._file.write(line + b"\n")

    def close(self) -> None:
        """Close."""
        self._file.close()


class LineLog:
    """A file of lines, each of which reaches the system before the next; what is there already stays."""

    def __init__(self, path: Path) -> None:
        """Create the file where there is none."""
        self._file = _open_for_writing(path, "ab")

    def write(self, line: bytes) -> None:
        """Append a line, its end included."""
        self._file.write(line)

    def close(self) -> None:
        """Close."""
        self._file.close()


class TlogWriter:
    """A telemetry log that is written frame by frame."""

    def __init__(self, path: Path) -> None:
        """Create the file."""
        self._file = _open_for_writing(path)

    def write(self, time_us: int, frames: Iterable[bytes]) -> None:
        """Append frames, all of simulated time `time_us`."""
        stamp = STAMP.pack(time_us)
        self._file.write(b"".join([stamp + frame for frame in frames]))

    def close(self) -> None:
        """Close."""
        self._file.close()


def _open_for_writing(path: Path, how: Literal["wb", "ab"] = "wb") -> FileIO:
    """Open a file whose every write reaches the system, its folder made where it is missing, or end with one line."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return path.open(how, buffering=0)
    except OSError as error:
        fail(f"cannot write {path}: {error.strerror}")
