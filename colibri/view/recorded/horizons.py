"""Predicted horizons of a recorded flight: its logs hold none, so the autopilot answers the same frames once more.

That happens in a process of its own, meanwhile the flight can be watched already: `python -m
colibri.view.recorded.horizons DIR` prints a horizon a line, its time and then the coordinates of its points.
"""

import os
import subprocess
import sys
from bisect import bisect_right
from pathlib import Path
from threading import Thread

import numpy as np

from colibri.common.errors import Error
from colibri.common.types import Array
from colibri.view.snapshot import NO_POINTS

_STALE_S = 0.3
"""A horizon that old is not shown: the controller's QP was not solved since."""
_NICE = 15
"""The page comes first, and the browser that draws it."""


class Horizons:
    """Horizons by time, as they become known."""

    def __init__(self) -> None:
        """Know none."""
        self._known: tuple[list[float], list[Array]] = ([], [])

    def add(self, time_s: float, points: Array) -> None:
        """Append the next one, (k, 3)."""
        times_s, horizons = self._known
        horizons.append(points)
        times_s.append(time_s)  # last: who looks it up from another thread finds its points

    def at(self, time_s: float) -> Array:
        """Return the latest until a time, (k, 3); empty where there is none."""
        times_s, horizons = self._known
        row = bisect_right(times_s, time_s + 1e-9) - 1
        return horizons[row] if row >= 0 and time_s - times_s[row] <= _STALE_S else NO_POINTS


class HorizonProcess:
    """The process that predicts the horizons of a flight, and the thread that reads them."""

    def __init__(self, folder: Path, horizons: Horizons) -> None:
        """Begin."""
        command = [sys.executable, "-m", "colibri.view.recorded.horizons", str(folder)]
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        self._thread = Thread(target=self._read, args=(horizons,), daemon=True)
        self._thread.start()

    def wait(self) -> int:
        """Wait until all are there; return the exit code."""
        self._thread.join()
        return self._process.wait()

    def close(self) -> None:
        """End it."""
        self._process.kill()
        self.wait()

    def _read(self, horizons: Horizons) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as lines:
            for line in lines:
                if not line.endswith("\n"):  # it was ended in the middle of it
                    return
                time_s, *points = map(float, line.split())
                horizons.add(time_s, np.reshape(points, (-1, 3)))


def main() -> int:
    """Print the horizons of the flight of a folder; return the exit code."""
    os.nice(_NICE)
    from colibri.view.recorded.prediction import (
        predicted,  # takes a second of a core, which the page does not have to wait for
    )

    try:
        for time_s, points in predicted(Path(sys.argv[1])):
            print(time_s, *points.ravel().round(4).tolist())  # noqa: T201
    except (Error, OSError) as error:
        print(error, file=sys.stderr)  # noqa: T201
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
