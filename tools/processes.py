"""A flight as two processes over UDP: started, watched, ended."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from math import isfinite
from select import select
from typing import IO, Any

from tools.plan import FlightPlan
from tools.recording import Summary

_LOOK_EVERY_S = 0.1
_GRACE_S = 3.0


class FlightError(Exception):
    """A process ended before its flight did.

    Attributes:
        code: What the exit code shall be.
        said: Whether the process already told the user why.
    """

    def __init__(self, message: str, code: int, *, said: bool) -> None:
        """Fail with `message`."""
        super().__init__(message)
        self.code = code
        self.said = said


def fly_processes(plan: FlightPlan, progress: Callable[[float], None]) -> Summary:
    """Fly `plan` as two processes on a free port; `progress` is told the simulated time in s.

    Both are gone when this returns or raises.

    Raises:
        FlightError: One of them ended before the flight did.
    """
    processes: dict[str, subprocess.Popen[bytes]] = {}
    try:
        plant = processes["plant"] = _start("plant", *_plant_options(plan), stdout=subprocess.PIPE)
        assert plant.stdout is not None
        for event in _events(plant.stdout, lambda: _check_alive(processes)):
            if event["event"] == "listening":
                url = event["url"].replace("udpin", "udpout")
                processes["autopilot"] = _start("autopilot", "--plant", url, *_autopilot_options(plan))
            elif event["event"] == "progress":
                progress(event["sim_time_s"])
            elif event["event"] == "ended":
                return Summary(event["wall_time_s"], event["frames"], event["resent"])
        plant.wait()
        _check_alive(processes)
        raise FlightError("the plant ended without a word", 1, said=False)
    finally:
        _end(list(processes.values()))


def _start(package: str, *options: str, stdout: int = subprocess.DEVNULL) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", package, "--json", "--with-parent", *options]
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=stdout)


def _plant_options(plan: FlightPlan) -> list[str]:
    return [
        *("--link", "udpin:127.0.0.1:0"),
        *("--vehicle", plan.plant_vehicle_name),
        *("--integrator", plan.integrator),
        *(f"--without={part}" for part in plan.without),
        *("--wind", str(plan.wind)),
        *("--start", str(plan.start)),
        *("--duration", repr(plan.duration_s)),
        *("--speed", repr(plan.speed) if isfinite(plan.speed) else "max"),
        *("--out", str(plan.out)),
    ]


def _autopilot_options(plan: FlightPlan) -> list[str]:
    return [
        *("--track", plan.track_name),
        *("--profile", plan.profile_name),
        *("--vehicle", plan.vehicle_name),
        *("--controller", plan.profile.controller),
        *(("--solver", plan.solver) if plan.solver else ()),
        *("--out", str(plan.out)),
    ]


def _events(stream: IO[bytes], look: Callable[[], None]) -> Iterator[dict[str, Any]]:
    """Yield the JSON lines of a process until it closes its output; `look` is called while nothing comes."""
    rest = b""
    while True:
        ready, _, _ = select([stream], [], [], _LOOK_EVERY_S)
        if not ready:
            look()
            continue
        chunk = os.read(stream.fileno(), 65536)
        if not chunk:
            return
        *lines, rest = (rest + chunk).split(b"\n")
        yield from map(json.loads, lines)


def _check_alive(processes: dict[str, subprocess.Popen[bytes]]) -> None:
    for name, process in processes.items():
        code = process.poll()
        if code is None or code == 0:
            continue
        if code < 0:
            raise FlightError(f"the {name} was killed by {signal.Signals(-code).name}", 1, said=False)
        raise FlightError(f"the {name} ended with exit code {code}", code, said=True)


def _end(processes: list[subprocess.Popen[bytes]]) -> None:
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
