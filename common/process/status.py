"""Status lines: in words for a user, as JSON for whoever started the process."""

import json
import os
import sys
from typing import Any, TextIO


class Status:
    """Reports what the process is doing: lines for a person on standard error, or JSON lines on standard output."""

    def __init__(self, name: str, *, as_json: bool) -> None:
        """Speak as `name`."""
        self._name = name
        self.as_json = as_json
        self._stream: TextIO | None = None

    def take_standard_output(self) -> None:
        """Keep standard output for status lines alone: what else is printed, by a control law say, is an error line."""
        self._stream = os.fdopen(os.dup(1), "w", encoding="utf-8")
        os.dup2(2, 1)

    def say(self, event: str, text: str, **facts: Any) -> None:
        """Report `event`: `text` for a person, `facts` for a program."""
        if self.as_json:
            _print(self._stream or sys.stdout, json.dumps({"event": event, "text": text, **facts}))
        else:
            _print(sys.stderr, f"{self._name}: {text}")


def _print(stream: TextIO, line: str) -> None:
    """Print a line; where nobody reads any more, for good into the void: `Stop` sees whose end that was."""
    try:
        stream.write(line + "\n")
        stream.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


class Progress:
    """Reports how far a flight is, often to a program and seldom to a person."""

    def __init__(self, status: Status) -> None:
        """Report through `status`."""
        self._status = status
        self._every_s = 0.1 if status.as_json else 2.0
        self._due_s = self._every_s

    def report(self, sim_time_s: float, wall_time_s: float) -> None:
        """Report, if it is time to."""
        if wall_time_s < self._due_s:
            return
        self._due_s = wall_time_s + self._every_s
        text = f"t = {sim_time_s:.1f} s, {sim_time_s / wall_time_s:.0f} times real time"
        self._status.say("progress", text, sim_time_s=sim_time_s, wall_time_s=wall_time_s)
