"""Predicted horizons of a recorded flight, by replay in another process.

`python -m colibri.view.recorded.horizons DIR` prints time and coordinates of each.
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

_STALE_S = 0.3  # age from which a horizon is hidden
_NICE = 15  # page and browser have priority


class Horizons:
    """Horizons by time, added from another thread."""

    def __init__(self) -> None:
        self._known: tuple[list[float], list[Array]] = ([], [])

    def add(self, time_s: float, points: Array) -> None:
        times_s, horizons = self._known
        horizons.append(points)
        times_s.append(time_s)  # last: who looks it up from another thread finds its points

    def at(self, time_s: float) -> Array:
        """Return the latest at a time, (k, 3), if any."""
        times_s, horizons = self._known
        row = bisect_right(times_s, time_s + 1e-9) - 1
        return horizons[row] if row >= 0 and time_s - times_s[row] <= _STALE_S else NO_POINTS


class HorizonProcess:
    """The process that predicts, and the thread that reads."""

    def __init__(self, folder: Path, horizons: Horizons) -> None:
        command = [sys.executable, "-m", "colibri.view.recorded.horizons", str(folder)]
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        self._thread = Thread(target=self._read, args=(horizons,), daemon=True)
        self._thread.start()

    def wait(self) -> int:
        self._thread.join()
        return self._process.wait()

    def close(self) -> None:
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
