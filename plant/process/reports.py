"""Reports of the plant's servers: silence of the autopilot, end of the flight, errors."""

import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from typing import Any, Protocol

from colibri.common.errors import Error
from colibri.common.process.failure_file import keep_failure
from colibri.common.process.lifecycle import EXIT_FAILED, fail, gc_frozen
from colibri.common.process.status import Status
from colibri.mavlink.links.link import GroundLink

MAX_WAIT_S = 0.1  # between two checks whether the process shall end
SILENT_AFTER_S = 2.0  # wall-clock silence that is reported


class Closable(Protocol):
    def close(self) -> None: ...


def awaiting(whom: str, link: GroundLink) -> str:
    return f"waiting for {whom} on {link.url}" if link.target is None else f"connecting to {whom} at {link.url}"


def all_parameters_by(vehicle: str, whom: str) -> str:
    return f"all parameters: colibri vehicle {shlex.quote(vehicle)} --for {whom}"


@contextmanager
def closing(*opened: Closable | None, out: Path | None = None) -> Iterator[None]:
    """Fly without garbage collection, then close `opened`; an error ends the process with one line."""
    try:
        with gc_frozen():
            yield
    except Error as error:
        fail(keep_failure(error, out), EXIT_FAILED)
    finally:
        for each in opened:
            if each:
                each.close()


class Silence:
    """Reports once that an autopilot is silent, and once that it is back."""

    def __init__(self, status: Status, allowed_s: float, back: str, began_s: float) -> None:
        self._status, self._allowed_s, self._back = status, allowed_s, back
        self._since_s, self._reported = began_s, False

    def end(self, now_s: float) -> None:
        if self._reported:
            self._status.say("answered", self._back)
        self._since_s, self._reported = now_s, False

    def lasts(self, now_s: float, missing: str, time_us: int, waiting: str) -> bool:
        if self._reported or now_s - self._since_s < self._allowed_s:
            return False
        self._reported = True
        self._status.say("silence", f"{missing} at t = {time_us / 1e6:.3f} s{waiting}")
        return True


def report_end(
    status: Status,
    time_us: int,
    began_s: float,
    text: str,
    *,
    event: str = "ended",
    ended_s: float | None = None,
    **figures: Any,
) -> None:
    time_s = time_us / 1e6
    wall_time_s = (perf_counter() if ended_s is None else ended_s) - began_s
    status.say(event, text.format(f"at t = {time_s:.3f} s"), sim_time_s=time_s, wall_time_s=wall_time_s, **figures)
