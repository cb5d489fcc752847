"""Plant and autopilot forked from a process that has loaded what both need: that takes longer than most flights."""

import os
import signal
import sys
from collections.abc import Sequence
from contextlib import suppress
from math import inf
from pathlib import Path
from subprocess import TimeoutExpired
from time import monotonic, sleep
from typing import NoReturn

_TASKS = Path("/proc/self/task")
_NAME = Path("/proc/self/comm")
_LOOK_EVERY_S = 0.01


def can_fork() -> bool:
    """Return whether this process may be forked: on Linux, with one thread, as others would hold their locks forever.

    Elsewhere libraries of the system keep threads of their own.
    """
    return _TASKS.is_dir() and len(list(_TASKS.iterdir())) == 1


def fork(package: str, options: Sequence[str], stdout: int, stderr: int) -> int:
    """Fork a process that is `colibri PACKAGE` with `options`, in a process group of its own; return its number.

    It writes to the files of the numbers `stdout` and `stderr`, and ends when this process does.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    parent = os.getpid()
    number = os.fork()
    if number:
        return number
    try:
        for each in (signal.SIGINT, signal.SIGTERM):
            signal.signal(each, signal.SIG_DFL)
        os.setpgid(0, 0)
        _use_safe_path()
        for to, of in ((0, os.open(os.devnull, os.O_RDONLY)), (1, stdout), (2, stderr)):
            os.dup2(of, to)
        sys.stdout, sys.stderr = (os.fdopen(it, "w", buffering=1, closefd=False) for it in (1, 2))
        with suppress(OSError):
            _NAME.write_text(package)
        _be(package, ["--parent", str(parent), *options])
    finally:
        os._exit(1)


def _use_safe_path() -> None:
    """Take off the path what -P leaves off: modules of the working directory shadow none that are still to be loaded.

    It need not be the first any more: whoever flies from Python may have put folders before it.
    """
    if not sys.flags.safe_path:
        unsafe = ("", os.getcwd(), os.path.dirname(os.path.abspath(sys.argv[0])))
        place = next((place for place, folder in enumerate(sys.path) if folder in unsafe), None)
        if place is not None:
            del sys.path[place]


def _be(package: str, options: Sequence[str]) -> NoReturn:
    """Be `colibri PACKAGE`, to the end of this process."""
    code = 1
    try:
        if package == "plant":
            from colibri.plant.__main__ import main
        else:
            from colibri.autopilot.__main__ import main
        code = main(options)
    except SystemExit as error:
        code = error.code if isinstance(error.code, int) else 1
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


class ForkedProcess:
    """A forked process, with what of `subprocess.Popen` is asked for.

    Attributes:
        pid: Its number.
        stdout: What it writes.
        returncode: Its exit code, negative for a signal, as far as it is known.
    """

    def __init__(self, package: str, options: Sequence[str]) -> None:
        """Fork it; its standard output is piped, its standard error is this process's."""
        read, write = os.pipe()
        self.pid = fork(package, options, stdout=write, stderr=2)
        os.close(write)
        self.stdout = os.fdopen(read, "rb", buffering=0)
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """Return its exit code, negative for a signal; None while it runs."""
        return self._waited(os.WNOHANG)

    def wait(self, timeout: float | None = None) -> int:
        """Return its exit code, when it has ended.

        Raises:
            TimeoutExpired: It has not in `timeout`, s.
        """
        end_s = inf if timeout is None else monotonic() + timeout
        while (code := self._waited(0 if timeout is None else os.WNOHANG)) is None:
            if monotonic() > end_s:
                raise TimeoutExpired(str(self.pid), timeout or 0.0)
            sleep(_LOOK_EVERY_S)
        return code

    def terminate(self) -> None:
        """Ask it to end."""
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """Kill it."""
        self.send_signal(signal.SIGKILL)

    def send_signal(self, which: int) -> None:
        """Send it a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, which)

    def _waited(self, options: int) -> int | None:
        if self.returncode is None:
            ended, status = os.waitpid(self.pid, options)
            self.returncode = os.waitstatus_to_exitcode(status) if ended else None
        return self.returncode
