"""Predicted horizons of a recorded flight: its logs hold none, so the autopilot answers the same frames once more.

That happens in a process of its own, meanwhile the flight can be watched already: `python -m colibri.view.horizons DIR`
prints a horizon a line, its time and then the coordinates of its points.
"""

import os
import subprocess
import sys
from bisect import bisect_right
from collections.abc import Iterator
from pathlib import Path
from threading import Thread

import numpy as np

from colibri.autopilot.control.loop import ControlLoop
from colibri.autopilot.ground.forecast import Forecaster
from colibri.common.errors import Error
from colibri.common.types import Array
from colibri.flights.plan import FlightPlan
from colibri.flights.provenance import plan_of
from colibri.flights.replay import TLOG, answers_of
from colibri.view.snapshot import NO_POINTS

EVERY = 5
"""Control samples between two horizons that are kept: 25 a second at 125 Hz."""
_STALE_S = 0.3
"""A horizon that old is not shown: the controller's QP was not solved since."""
_NICE = 10


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
        command = [sys.executable, "-m", "colibri.view.horizons", str(folder)]
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
                time_s, *points = map(float, line.split())
                horizons.add(time_s, np.reshape(points, (-1, 3)))


def predicted(folder: Path) -> Iterator[tuple[float, Array]]:
    """Yield time and points of each horizon of a flight, (k, 3), the first where the vehicle took itself to be.

    Raises:
        Error: The flight cannot be replayed, or its control law does not plan ahead.
    """
    plan = plan_of(folder)
    loop = ControlLoop(plan.profile, plan.vehicle, lambda: 0.0, plan.law)
    forecaster = _forecaster(plan, loop)
    decisions = 0
    for answer in answers_of(folder / TLOG):
        if answer.step.decision is None or answer.known is None:
            continue
        decisions += 1
        if decisions % EVERY == 1:
            points = forecaster.forecast(loop.state(answer.known), None, answer.step.decision.diagnostics)
            if points:
                here = answer.known.position_enu_m
                yield answer.time_us / 1e6, np.array([here, *(point.position_enu_m for point in points)])


def _forecaster(plan: FlightPlan, loop: ControlLoop) -> Forecaster:
    return Forecaster(plan.vehicle, loop.control_interval_us / 1e6, loop.plan_columns)


def main() -> int:
    """Print the horizons of the flight of a folder; return the exit code."""
    os.nice(_NICE)
    try:
        for time_s, points in predicted(Path(sys.argv[1])):
            print(time_s, *points.ravel().round(4).tolist())  # noqa: T201
    except (Error, OSError) as error:
        print(error, file=sys.stderr)  # noqa: T201
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
