"""Status lines: in words for a user, as JSON for whoever started the process."""

import json
import sys
from typing import Any


class Status:
    """Reports what the process is doing: lines for a person on standard error, or JSON lines on standard output."""

    def __init__(self, name: str, *, as_json: bool) -> None:
        """Speak as `name`."""
        self._name = name
        self.as_json = as_json

    def say(self, event: str, text: str, **facts: Any) -> None:
        """Report `event`: `text` for a person, `facts` for a program."""
        if self.as_json:
            sys.stdout.write(json.dumps({"event": event, "text": text, **facts}) + "\n")
            sys.stdout.flush()
        else:
            sys.stderr.write(f"{self._name}: {text}\n")
            sys.stderr.flush()


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
