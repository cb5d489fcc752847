"""Start the processes of a flight."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from colibri.common.spec import to_json
from colibri.flights.launcher import Child, ProcessSpec, how_it_ended, name_of
from colibri.sitl.backends.link_faults import SessionError

_LAST_WORDS_BYTES = 2000


class Launcher:
    """Starts processes `from_scratch` as a user does, or forks each autopilot from a loaded server.

    Plants then run in the test's process: on a shared core two processes make better use of the caches than three.
    """

    def __init__(self, *, from_scratch: bool = False) -> None:
        self.starts_plants = from_scratch or not hasattr(os, "fork")
        self._server: subprocess.Popen[bytes] | None = None
        if not self.starts_plants:
            command = [sys.executable, "-P", "-m", "colibri.sitl.backends.fork_server"]
            self._server = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, process_group=0)

    def close(self) -> None:
        if self._server is not None:
            self._server.communicate()

    def request(self, *words: str) -> int | None:
        """Ask the server, as `fork_server` describes."""
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


class LoggedChild:
    def __init__(self, launcher: Launcher, spec: ProcessSpec, log: Path) -> None:
        self.name, self.log = name_of(spec), log
        self._launcher = launcher
        self._child = Child(spec, log=log) if launcher.starts_plants else None
        self._code: int | None = None
        if self._child is not None:
            self.number = self._child.number
            return
        log.touch()
        number = launcher.request("start", self.name, str(log), to_json(spec).decode())
        assert number is not None, "whatever is forked has a number"
        self.number = number

    def check(self) -> None:
        """Raise SessionError if the process has died."""
        code = self._ask("code")
        if code is not None:
            text = self.log.read_bytes()[-_LAST_WORDS_BYTES:].decode(errors="replace")
            lines = [line for line in text.splitlines() if line and not line.startswith("{")]
            raise SessionError(": ".join([f"the {self.name} {how_it_ended(code)}", *lines[-1:]]))

    def kill(self) -> None:
        self._ask("kill")

    def _ask(self, what: Literal["code", "kill"]) -> int | None:
        if self._child is None:
            self._code = self._launcher.request(what, str(self.number)) if self._code is None else self._code
            return self._code
        if what == "kill":
            self._child.kill()
        return self._child.code()


@contextmanager
def one_core(worker: int, workers: int) -> Iterator[None]:
    """Pin this thread and its processes to one core if workers occupy all: in lockstep, waking another costs more."""
    cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_setaffinity") else []
    if not cores or not workers or workers % len(cores):  # a core may be idle, or would have more to do than others
        yield
        return
    os.sched_setaffinity(0, {cores[worker % len(cores)]})
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)
