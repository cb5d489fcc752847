"""Start the processes of a flight."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from colibri.common.spec import to_json
from colibri.flights.launcher import Child, ProcessSpec, how_it_ended, name_of
from colibri.sitl.backends.lockstep import SessionError

_LAST_WORDS_BYTES = 2000


class Launcher:
    """Starts processes `from_scratch` as a user does, or forks each autopilot from a loaded server.

    Loading takes longer than most flights. A server starts no plants, which run in the test's process: on a shared
    core, two processes make better use of the caches than three.
    """

    def __init__(self, *, from_scratch: bool = False) -> None:
        self.starts_plants = from_scratch or not hasattr(os, "fork")
        self._server: subprocess.Popen[bytes] | None = None
        if not self.starts_plants:
            command = [sys.executable, "-P", "-m", "colibri.sitl.backends.fork_server"]
            self._server = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, process_group=0)

    def start(self, spec: ProcessSpec, log: Path) -> "Child | _ForkedChild":
        if self._server is None:
            return Child(spec, log=log)
        log.touch()
        pid = self._request("start", name_of(spec), str(log), to_json(spec).decode())
        assert pid is not None, "whatever is forked has a number"
        return _ForkedChild(pid, self._request)

    def close(self) -> None:
        if self._server is not None:
            self._server.communicate()

    def _request(self, *words: str) -> int | None:
        assert self._server is not None, "it was started"
        stdin, stdout = self._server.stdin, self._server.stdout
        assert stdin is not None, "it is piped"
        assert stdout is not None, "it is piped"
        try:
            stdin.write(json.dumps(words).encode() + b"\n")
            stdin.flush()
            answer: int | None = json.loads(stdout.readline())
        except (OSError, ValueError) as error:
            raise SessionError("the process that starts others has died; try --sitl-from-scratch") from error
        return answer


class _ForkedChild:
    def __init__(self, pid: int, request: Callable[..., int | None]) -> None:
        self.number = pid
        self._request = request
        self._code: int | None = None

    def code(self) -> int | None:
        if self._code is None:
            self._code = self._request("code", str(self.number))
        return self._code

    def kill(self) -> None:
        if self._code is None:
            self._code = self._request("kill", str(self.number))


class LoggedChild:
    def __init__(self, launcher: Launcher, spec: ProcessSpec, log: Path) -> None:
        self.name = name_of(spec)
        self.log = log
        self._running = launcher.start(spec, log)
        self.number = self._running.number

    def check(self) -> None:
        """Raise SessionError if the process has died."""
        code = self._running.code()
        if code is None:
            return
        words = self.last_words()
        raise SessionError(f"the {self.name} {how_it_ended(code)}" + (f": {words}" if words else ""))

    def last_words(self) -> str:
        text = self.log.read_bytes()[-_LAST_WORDS_BYTES:].decode(errors="replace")
        lines = [line for line in text.splitlines() if line and not line.startswith("{")]
        return lines[-1] if lines else ""

    def kill(self) -> None:
        self._running.kill()


@contextmanager
def one_core(worker: int, workers: int) -> Iterator[None]:
    """Pin this thread and its processes to one core if workers occupy all cores.

    In lockstep one process computes at a time, and waking another core costs much more.
    """
    cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_setaffinity") else []
    if not cores or not workers or workers % len(cores):  # a core may be idle, or would have more to do than others
        yield
        return
    os.sched_setaffinity(0, {cores[worker % len(cores)]})
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)
