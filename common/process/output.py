"""Output that never waits for its reader."""

import atexit
import io
import os
import stat
import sys
from collections import deque
from contextlib import suppress
from select import select

_MOST_BYTES = 1 << 20
_LOOKS, _LOOK_S = 10, 0.1  # number and duration of the waits for a reader at the end
_PIECE = 512  # bytes that a pipe or terminal takes at once if it takes any
_LEFT_OUT = "colibri: {} lines dropped: the output was not read\n"


class Output(io.RawIOBase):
    """A file descriptor that never waits for its reader; unread output is buffered, beyond `_MOST_BYTES` dropped."""

    def __init__(self, number: int, *, left_out: str = _LEFT_OUT, patient: bool = False) -> None:
        self._number, self._left_out_text, self._patient = number, left_out, patient
        self._own = _opened_again(number)
        self._process = os.getpid()
        self._waiting: deque[bytes] = deque()
        self._size = self._left_out = 0
        _outputs.append(self)

    def fileno(self) -> int:
        return self._number

    def isatty(self) -> bool:
        return os.isatty(self._number)

    def writable(self) -> bool:
        return True

    def write(self, data: bytes) -> int:  # type: ignore[override]
        self._waiting.append(bytes(data))
        self._size += len(data)
        while self._size > _MOST_BYTES and len(self._waiting) > 1:
            self._size -= len(self._waiting[1])
            self._left_out += 1
            del self._waiting[1]
        self._pass_on()
        return len(data)

    def finish(self) -> None:
        """Wait a moment for the reader; a forked process leaves that to its parent."""
        if self._process != os.getpid():
            return
        if self._left_out:
            self.write(self._left_out_text.format(self._left_out).encode())
        looks = 0
        while self._waiting and (self._patient or looks < _LOOKS):
            looks += 1
            select([], [self._number], [], _LOOK_S)
            self._pass_on()

    def _pass_on(self) -> None:
        while self._waiting:
            first = self._waiting.popleft()  # whole, as several threads may write
            try:
                count = self._taken(first)
            except OSError:  # the reader has gone
                self._waiting.clear()
                self._size = 0
                return
            self._size -= count
            if count < len(first):
                self._waiting.appendleft(first[count:])
            if not count:
                return

    def _taken(self, data: bytes) -> int:
        try:
            if self._own is not None:
                return os.write(self._own, data)
            return os.write(self._number, data[:_PIECE]) if select([], [self._number], [], 0.0)[1] else 0
        except BlockingIOError:
            return 0


_outputs: list[Output] = []


@atexit.register
def finish_outputs() -> None:
    for output in _outputs:
        output.finish()


def _opened_again(number: int) -> int | None:
    """Open a pipe or terminal again: `O_NONBLOCK` on the first would affect its other users."""
    if stat.S_ISFIFO(os.fstat(number).st_mode) or os.isatty(number):
        with suppress(OSError):
            return os.open(f"/proc/self/fd/{number}", os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    return None


def text_output(output: Output, encoding: str = "utf-8") -> io.TextIOWrapper:
    return io.TextIOWrapper(output, encoding, "backslashreplace", write_through=True)  # type: ignore[arg-type]


def use_streams() -> None:
    """Escape what the streams cannot encode; standard error waits for no reader, closed streams are the null device."""
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_RDWR), "r" if name == "stdin" else "w"))
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    with suppress(AttributeError, OSError):  # closed, or a test's
        if sys.stderr.fileno() == 2 and not stat.S_ISREG(os.fstat(2).st_mode):
            sys.stderr = text_output(Output(2), sys.stderr.encoding)
