"""Start, watch and end plant and autopilot as child processes.

A child is forked if this process may be: loading takes longer than most flights. Otherwise it is started as a command,
and reads its specification as JSON from standard input.

Each has its own process group, so that Ctrl-C reaches only this process, which ends its children in order: SIGTERM,
then
SIGKILL after the grace period. Each also ends if this process dies.
"""

import json
import os
import signal
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from multiprocessing import current_process, get_context
from pathlib import Path
from select import select
from typing import Any, NoReturn, TypeAlias

from colibri.autopilot.spec import AutopilotSpec
from colibri.common.process.spec import Starter
from colibri.common.spec import to_json
from colibri.plant.spec import PlantSpec

ProcessSpec: TypeAlias = PlantSpec | AutopilotSpec

_TASKS = Path("/proc/self/task")
_NAME = Path("/proc/self/comm")
_LOOK_EVERY_S = 0.1
_GRACE_S = 5.0


def name_of(spec: ProcessSpec) -> str:
    return "plant" if isinstance(spec, PlantSpec) else "autopilot"


def can_fork() -> bool:
    """Whether this process may be forked: on Linux with one thread, as locks of others would stay held."""
    return _TASKS.is_dir() and len(list(_TASKS.iterdir())) == 1 and not current_process().daemon


class Child:
    """A plant or an autopilot as a child of this process, which ends with it."""

    def __init__(self, spec: ProcessSpec, *, fork: bool = False, log: Path | None = None) -> None:
        """Start it; its output goes to file `log` or to pipe `stdout`."""
        self.name = name_of(spec)
        self.forked = fork and can_fork()
        self._rest = b""
        read, out = os.pipe() if log is None else (None, os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND))
        error = 2 if log is None else out
        try:
            self._process = Fork(spec, out, error) if self.forked else _Anew(spec, out, error)
        finally:
            os.close(out)
        self.number = self._process.number
        self.stdout = None if read is None else os.fdopen(read, "rb", buffering=0)

    def code(self) -> int | None:
        """Return the exit code, negative for a signal; `None` while it runs."""
        return self._process.code()

    def read(self) -> list[dict[str, Any]]:
        """Return the events printed since the last time; wait for the first."""
        assert self.stdout is not None, "read only where it is piped"
        *lines, self._rest = (self._rest + os.read(self.stdout.fileno(), 65536)).split(b"\n")
        return [json.loads(line) for line in lines]

    def terminate(self) -> None:
        if self.code() is None:
            os.kill(self.number, signal.SIGTERM)

    def wait(self, timeout_s: float | None = None) -> int | None:
        return self._process.wait(timeout_s)

    def kill(self) -> None:
        if self.code() is None:
            os.kill(self.number, signal.SIGKILL)
            self.wait()

    def close(self) -> None:
        if self.stdout is not None:
            self.stdout.close()


class Fork:
    """A process forked from this one."""

    def __init__(self, spec: ProcessSpec, stdout: int, stderr: int) -> None:
        self._process = get_context("fork").Process(target=_fly, args=(spec, stdout, stderr, os.getpid()), daemon=True)
        self._process.start()
        assert self._process.pid is not None, "it was started"
        self.number = self._process.pid

    def code(self) -> int | None:
        return self._process.exitcode

    def wait(self, timeout_s: float | None = None) -> int | None:
        self._process.join(timeout_s)
        return self._process.exitcode


class _Anew:
    """A process started as a command; -P keeps modules of the working directory from shadowing Python's."""

    def __init__(self, spec: ProcessSpec, stdout: int, stderr: int) -> None:
        import subprocess

        text = to_json(spec)
        options = ["--json", "--parent", str(os.getpid()), "--spec"]
        command = [sys.executable, "-P", "-m", f"colibri.{name_of(spec)}", *options]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=stdout, stderr=stderr if stderr != 2 else None, process_group=0
        )
        assert self._process.stdin is not None, "it is piped"
        with suppress(BrokenPipeError), self._process.stdin as stdin:
            stdin.write(text)
        self.number = self._process.pid

    def code(self) -> int | None:
        return self._process.poll()

    def wait(self, timeout_s: float | None = None) -> int | None:
        from subprocess import TimeoutExpired

        with suppress(TimeoutExpired):
            return self._process.wait(timeout_s)
        return None


def _fly(spec: ProcessSpec, stdout: int, stderr: int, parent: int) -> NoReturn:
    for each in (signal.SIGINT, signal.SIGTERM):
        signal.signal(each, signal.SIG_DFL)
    os.setpgid(0, 0)
    _use_safe_path()
    for to, of in ((0, os.open(os.devnull, os.O_RDONLY)), (1, stdout), (2, stderr)):
        os.dup2(of, to)
    sys.stdout, sys.stderr = (os.fdopen(it, "w", buffering=1, closefd=False) for it in (1, 2))
    with suppress(OSError):
        _NAME.write_text(name_of(spec))
    starter = Starter(as_json=True, parent=parent)
    if isinstance(spec, PlantSpec):
        from colibri.plant.__main__ import run_plant

        sys.exit(run_plant(spec, starter))
    from colibri.autopilot.__main__ import run_autopilot

    sys.exit(run_autopilot(spec, starter))


def _use_safe_path() -> None:
    """Remove the path that -P leaves out; a script may have put others before it."""
    if not sys.flags.safe_path:
        unsafe = ("", os.getcwd(), os.path.dirname(os.path.abspath(sys.argv[0])))
        place = next((place for place, folder in enumerate(sys.path) if folder in unsafe), None)
        if place is not None:
            del sys.path[place]


def events_of(children: Iterable[Child]) -> Iterator[tuple[Child, dict[str, Any]]]:
    """Yield the events that children have printed, waiting a moment for them."""
    streams = {child.stdout: child for child in children if child.stdout is not None}
    ready, _, _ = select(list(streams), [], [], _LOOK_EVERY_S)
    for stream in ready:
        for event in streams[stream].read():
            yield streams[stream], event


def how_it_ended(code: int) -> str:
    return f"was killed by {signal.Signals(-code).name}" if code < 0 else f"ended with exit code {code}"


def end_children(children: Iterable[Child]) -> None:
    """Terminate children; kill those still alive after the grace period."""
    several: Sequence[Child] = list(children)
    for child in several:
        child.terminate()
    for child in several:
        if child.wait(_GRACE_S) is None:
            child.kill()
        child.close()
