"""Child processes: started, their events read, ended."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from select import select
from typing import Any

_LOOK_EVERY_S = 0.1
_GRACE_S = 3.0


def start_child(package: str, *options: str, stdout: int) -> subprocess.Popen[bytes]:
    """Start `python -m colibri.PACKAGE`, which ends when this process does."""
    command = [sys.executable, "-m", f"colibri.{package}", "--json", "--parent", str(os.getpid()), *options]
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=stdout)


def events_of(
    processes: Mapping[str, subprocess.Popen[bytes]], look: Callable[[], None]
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the JSON lines of each process until one ends; `look` is called while nothing comes."""
    rest = dict.fromkeys(("plant", "autopilot"), b"")
    while True:
        streams = {process.stdout: name for name, process in processes.items() if process.stdout is not None}
        ready, _, _ = select(list(streams), [], [], _LOOK_EVERY_S)
        if not ready:
            look()
        for stream in ready:
            name = streams[stream]
            chunk = os.read(stream.fileno(), 65536)
            if not chunk:
                processes[name].wait()
                return
            *lines, rest[name] = (rest[name] + chunk).split(b"\n")
            for line in lines:
                yield name, json.loads(line)


def end_children(processes: list[subprocess.Popen[bytes]]) -> None:
    """Ask each process to end, then make it."""
    for process in processes:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
    for process in processes:
        try:
            process.wait(_GRACE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if process.stdout:
            process.stdout.close()
