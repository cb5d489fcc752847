"""Start, watch and end plant and autopilot as child processes.

A child is forked if possible, as loading takes longer than most flights, or else a command that reads its specification
as JSON. Each has its own process group: Ctrl-C reaches only this process, which ends its children. A child also ends if
this process dies.
"""

import json
import os
import signal
import sys
import threading
import warnings
from collections.abc import Iterable, Iterator
from contextlib import suppress
from multiprocessing import current_process, get_context
from multiprocessing.process import BaseProcess
from pathlib import Path
from select import select
from typing import TYPE_CHECKING, Any, NoReturn, TypeAlias

from colibri.autopilot.spec import AutopilotSpec
from colibri.common.process.lifecycle import end_with, handle_endings
from colibri.common.process.output import finish_outputs
from colibri.common.process.spec import Starter
from colibri.common.spec import to_json
from colibri.plant.spec import PlantSpec

if TYPE_CHECKING:
    import subprocess

ProcessSpec: TypeAlias = PlantSpec | AutopilotSpec

_TASKS = Path("/proc/self/task")
_NAME = Path("/proc/self/comm")
_LOOK_EVERY_S = 0.1
_GRACE_S = 5.0


def name_of(spec: ProcessSpec) -> str:
    return "plant" if isinstance(spec, PlantSpec) else "autopilot"


def ready_to_fork() -> bool:
    """Make this process one that may be forked, if possible; else locks of other threads would stay held.

    A first fork, which ends at once, has OpenBLAS end its threads; it starts them again when it needs them.
    """
    if not _TASKS.is_dir() or current_process().daemon or threading.active_count() > 1:
        return False
    if _has_other_threads():
        with suppress(OSError), warnings.catch_warnings():  # Python warns if other threads are left
            warnings.simplefilter("ignore", DeprecationWarning)
            child = os.fork()
            if child == 0:
                os._exit(0)
            os.waitpid(child, 0)
    return not _has_other_threads()


def _has_other_threads() -> bool:
    return len(list(_TASKS.iterdir())) > 1


class Child:
    """A plant or an autopilot as a child of this process."""

    def __init__(self, spec: ProcessSpec, *, fork: bool = False, log: Path | None = None) -> None:
        self.name = name_of(spec)
        self.forked = fork and ready_to_fork()
        self._rest = b""
        read, out = os.pipe() if log is None else (None, os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND))
        error = 2 if log is None else out
        try:
            self._process = _forked(spec, out, error) if self.forked else _started(spec, out, error)
        finally:
            os.close(out)
        assert self._process.pid is not None, "it was started"
        self.number = self._process.pid
        self.stdout = None if read is None else os.fdopen(read, "rb", buffering=0)

    def code(self) -> int | None:
        """Return the exit code, negative for a signal; `None` while it runs."""
        return self._process.exitcode if isinstance(self._process, BaseProcess) else self._process.poll()

    def read(self) -> list[dict[str, Any]]:
        """Return the events printed since the last time, or wait for one."""
        assert self.stdout is not None, "read only where it is piped"
        *lines, self._rest = (self._rest + os.read(self.stdout.fileno(), 65536)).split(b"\n")
        return [json.loads(line) for line in lines]

    def is_stopped(self) -> bool:
        """Whether SIGSTOP or a debugger holds the process."""
        with suppress(ChildProcessError):
            return os.waitid(os.P_PID, self.number, os.WSTOPPED | os.WNOHANG | os.WNOWAIT) is not None
        return False

    def terminate(self) -> None:
        """Send SIGTERM, and SIGCONT, without which a stopped process would not receive it."""
        if self.code() is None:
            os.kill(self.number, signal.SIGTERM)
            os.kill(self.number, signal.SIGCONT)

    def wait(self, timeout_s: float | None = None) -> int | None:
        if isinstance(self._process, BaseProcess):
            self._process.join(timeout_s)
        else:
            from subprocess import TimeoutExpired

            with suppress(TimeoutExpired):
                self._process.wait(timeout_s)
        return self.code()

    def kill(self) -> None:
        if self.code() is None:
            os.kill(self.number, signal.SIGKILL)
            self.wait()

    def close(self) -> None:
        if self.stdout is not None:
            self.stdout.close()


def _forked(spec: ProcessSpec, stdout: int, stderr: int) -> BaseProcess:
    process = get_context("fork").Process(target=_fly, args=(spec, stdout, stderr, os.getpid()), daemon=True)
    process.start()
    return process


def _started(spec: ProcessSpec, stdout: int, stderr: int) -> "subprocess.Popen[bytes]":
    import subprocess

    text = to_json(spec)
    options = ["--json", "--parent", str(os.getpid()), "--spec"]
    command = [sys.executable, "-P", "-m", f"colibri.{name_of(spec)}", *options]
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=stdout, stderr=stderr if stderr != 2 else None, process_group=0
    )
    assert process.stdin is not None, "it is piped"
    with suppress(BrokenPipeError), process.stdin as stdin:
        stdin.write(text)
    return process


def _fly(spec: ProcessSpec, stdout: int, stderr: int, parent: int) -> NoReturn:
    handle_endings(signal.SIG_DFL)
    end_with(parent)
    os.setpgid(0, 0)
    _use_safe_path()
    for to, of in ((0, os.open(os.devnull, os.O_RDONLY)), (1, stdout), (2, stderr)):
        os.dup2(of, to)
    sys.stdout, sys.stderr = (os.fdopen(it, "w", buffering=1, closefd=False) for it in (1, 2))
    with suppress(OSError):
        _NAME.write_text(name_of(spec))
    starter = Starter(as_json=True, parent=parent)
    try:
        if isinstance(spec, PlantSpec):
            from colibri.plant.__main__ import run_plant

            sys.exit(run_plant(spec, starter))
        from colibri.autopilot.__main__ import run_autopilot

        sys.exit(run_autopilot(spec, starter))
    finally:
        finish_outputs()


def _use_safe_path() -> None:
    """Remove the path that -P leaves out."""
    if not sys.flags.safe_path:
        unsafe = ("", os.getcwd(), os.path.dirname(os.path.abspath(sys.argv[0])))
        place = next((place for place, folder in enumerate(sys.path) if folder in unsafe), None)
        if place is not None:
            del sys.path[place]


def events_of(children: Iterable[Child]) -> Iterator[tuple[Child, dict[str, Any]]]:
    """Yield the events that children print within a moment."""
    streams = {child.stdout: child for child in children if child.stdout is not None}
    ready, _, _ = select(list(streams), [], [], _LOOK_EVERY_S)
    for stream in ready:
        for event in streams[stream].read():
            yield streams[stream], event


def how_it_ended(code: int) -> str:
    if code < 0:
        return f"was killed by {signal.Signals(-code).name}"
    return f"was ended by {signal.Signals(code - 128).name}" if code > 128 else f"ended with exit code {code}"


def end_children(children: Iterable[Child]) -> None:
    """Terminate children, and kill those alive after the grace period."""
    several = list(children)
    for child in several:
        child.terminate()
    for child in several:
        if child.wait(_GRACE_S) is None:
            child.kill()
        child.close()
