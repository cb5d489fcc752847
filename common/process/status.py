"""Status lines: text for users, JSON for programs."""

import json
import os
import sys
from typing import Any, TextIO

from colibri.common.process.output import Output, text_output

_LEFT_OUT = '{{"event": "left_out", "text": "{0} lines dropped: the output was not read", "lines": {0}}}\n'


class Status:
    """Reports status as text on standard error, or JSON on standard output."""

    def __init__(self, name: str, *, as_json: bool) -> None:
        self._name = name
        self.as_json = as_json
        self._stream: TextIO | None = None

    def take_standard_output(self, *, patient: bool) -> None:
        """Reserve standard output for status; a `patient` process waits for its reader at the end."""
        self._stream = text_output(Output(os.dup(1), left_out=_LEFT_OUT, patient=patient))
        os.dup2(2, 1)

    def say(self, event: str, text: str, **facts: Any) -> None:
        if self.as_json:
            _print(self._stream or sys.stdout, json.dumps({"event": event, "text": text, **facts}))
        else:
            _print(sys.stderr, f"{self._name}: {text}")


class Silent(Status):
    """Reports nothing."""

    def __init__(self) -> None:
        super().__init__("", as_json=False)

    def say(self, event: str, text: str, **facts: Any) -> None: ...


def _print(stream: TextIO, line: str) -> None:
    try:
        stream.write(line + "\n")
        stream.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


class Progress:
    """Reports flight progress: every 0.1 s to programs, every 2 s to people."""

    def __init__(self, status: Status) -> None:
        self._status = status
        self._every_s = 0.1 if status.as_json else 2.0
        self._due_s = self._every_s

    def report(self, sim_time_s: float, wall_time_s: float) -> None:
        if wall_time_s < self._due_s:
            return
        self._due_s = wall_time_s + self._every_s
        text = f"t = {sim_time_s:.1f} s, {sim_time_s / wall_time_s:.0f} times real time"
        self._status.say("progress", text, sim_time_s=sim_time_s, wall_time_s=wall_time_s)
