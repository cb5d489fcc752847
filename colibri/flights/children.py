"""Child processes: started, their output read, watched, ended.

Each is in a process group of its own, out of reach of the terminal's Ctrl-C: that is for this process, which then ends
them, once and in its order. It does so by SIGTERM, which a child that is still loading obeys without a traceback; who
does not obey in time is killed. Where this process dies itself, they end by `--parent`.
"""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterable, Iterator, Sequence
from select import select
from typing import IO, Any

from colibri.flights.forked import ForkedProcess, can_fork

_LOOK_EVERY_S = 0.1
_GRACE_S = 5.0


class Child:
    """A plant or an autopilot, as a process.

    Attributes:
        name: Which of the two.
        process: Its process.
        number: Of the process.
    """

    def __init__(
        self,
        name: str,
        options: Sequence[str],
        *,
        stdout: int | IO[bytes] = subprocess.PIPE,
        stderr: IO[bytes] | None = None,
        fork: bool = False,
    ) -> None:
        """Start `python -P -m colibri.NAME` with `options`; it ends when this process does.

        With -P modules of the working directory, which may have any name, shadow none of Python's. `fork`: where this
        process may be forked, that is done in place of it, to start with what is loaded here; its output is piped.
        """
        self.name = name
        self.process: subprocess.Popen[bytes] | ForkedProcess
        if fork and can_fork():
            self.process = ForkedProcess(name, options)
        else:
            command = [sys.executable, "-P", "-m", f"colibri.{name}", "--parent", str(os.getpid()), *options]
            self.process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=stdout, stderr=stderr, process_group=0
            )
        self.number = self.process.pid
        self._rest = b""

    def code(self) -> int | None:
        """Return its exit code, negative for a signal; None while it runs."""
        return self.process.poll()

    def read(self) -> list[dict[str, Any]]:
        """Return the JSON lines that it has said since the last time; waits until there is something."""
        assert self.process.stdout is not None, "read only where it is piped"
        *lines, self._rest = (self._rest + os.read(self.process.stdout.fileno(), 65536)).split(b"\n")
        return [json.loads(line) for line in lines]

    def kill(self) -> None:
        """Kill it, and wait until it is gone."""
        self.process.kill()
        self.process.wait()


def events_of(children: Iterable[Child]) -> Iterator[tuple[Child, dict[str, Any]]]:
    """Yield the events that children have printed, waiting a moment for them."""
    streams = {child.process.stdout: child for child in children if child.process.stdout is not None}
    ready, _, _ = select(list(streams), [], [], _LOOK_EVERY_S)
    for stream in ready:
        for event in streams[stream].read():
            yield streams[stream], event


def how_it_ended(code: int) -> str:
    """Return an exit code in words."""
    return f"was killed by {signal.Signals(-code).name}" if code < 0 else f"ended with exit code {code}"


def end_children(children: Iterable[Child]) -> None:
    """Ask each to end, then make it."""
    processes = [child.process for child in children]
    for process in processes:
        if process.poll() is None:
            process.terminate()
    for process in processes:
        try:
            process.wait(_GRACE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if process.stdout:
            process.stdout.close()
