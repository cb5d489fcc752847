"""The time that each frame takes of an autopilot."""

from collections.abc import Callable
from time import thread_time
from typing import Any


class FrameTimes(list[float]):
    """Work of an autopilot in each frame, s: answer and ground stations."""

    def __init__(self, autopilot: Any) -> None:
        super().__init__()
        autopilot.step, autopilot.serve = self._timed(autopilot.step, begins=True), self._timed(autopilot.serve)

    def _timed(self, work: Callable[..., Any], *, begins: bool = False) -> Callable[..., Any]:
        def timed(*args: Any) -> Any:
            began_s = thread_time()
            outcome = work(*args)
            if begins:
                self.append(0.0)
            self[-1:] = [self[-1] + thread_time() - began_s] if self else []
            return outcome

        return timed
