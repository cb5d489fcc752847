"""`latency.md` and `latency.png`: profile `flight` flown over ever slower links."""

from collections.abc import Sequence
from math import pi
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from colibri.analysis.figures import GRID
from colibri.analysis.recording import Recording, read_recording
from colibri.analysis.tables import markdown
from colibri.common.errors import InFlightError
from colibri.flights.in_process import fly_locally
from colibri.flights.plan import FlightPlan

ROUND_TRIPS_MS = (*range(0, 31, 2), *range(40, 101, 10))
LOST_M = 5.0
SETTLED_M = 0.02
"""A step has settled where its last seconds stay so close."""

_HEAD = """# Latency between plant and autopilot

Profile `flight`, `hummingbird`, state feedback. The command that answers a frame acts a round trip after it, the one
before it is held until then (`colibri fly --latency MS`, one way: half of it). The control law knows nothing of it.
Written by `python -m tools.pages latency docs`; simulated, so the same again bit for bit.

Step: hover, begun 1 m beside it at rest, 12 s; the error is that of the last 4 s, RMS; overshoot is how far it goes
past. Lemniscate: 4 m, 6 s a lap, 5.9 m/s at most, begun at its speed, 20 s; RMS from 8 s on. *Lost*: more than 5 m
off, on the ground, or still upside down.

![Errors over the round trip](latency.png)

"""


class Case(NamedTuple):
    """A flight of the sweep.

    Attributes:
        name: What it is called.
        track: The track, with its options.
        start: Keys and values as in `colibri.plant.physics.start.Start`.
        duration_s: Simulated.
        judged_from_s: The error is taken from here on.
    """

    name: str
    track: str
    start: dict[str, float]
    duration_s: float
    judged_from_s: float


STEP = Case("step", "hover:height=10", {"x": 1.0, "y": 0.0, "z": 10.0}, 12.0, 8.0)
_SPEED_M_S = 4.0 * 2.0 * pi / 6.0
_ON_IT = {"x": 0.0, "y": 0.0, "z": 10.0, "vx": _SPEED_M_S, "vy": _SPEED_M_S}
LEMNISCATE = Case("lemniscate", "lemniscate:height=10", _ON_IT, 20.0, 8.0)


class Merit(NamedTuple):
    """How a flight went.

    Attributes:
        rms_m: Error, RMS, from when it is judged.
        overshoot_m: How far past the hover, along x.
        tilt_deg: The largest.
    """

    rms_m: float
    overshoot_m: float
    tilt_deg: float


class Point(NamedTuple):
    """Both flights at one round trip; None where the vehicle was lost.

    Attributes:
        round_trip_ms: Twice the latency.
        step: Of the step.
        lemniscate: Of the lemniscate.
    """

    round_trip_ms: float
    step: Merit | None
    lemniscate: Merit | None


def merit(recording: Recording, case: Case) -> Merit | None:
    """Return how a flight went; None if the vehicle was lost."""
    error, t = recording.position_error_m, recording["t"]
    upright = np.cos(recording["phi"]) * np.cos(recording["theta"])
    judged = t >= case.judged_from_s
    if t[-1] < case.duration_s - 0.1 or error.max() > LOST_M or upright[judged].min() < 0.0:
        return None
    return Merit(
        rms_m=float(np.sqrt(np.mean(error[judged] ** 2))),
        overshoot_m=float(max(0.0, -recording["x"].min())),
        tilt_deg=float(np.degrees(np.arccos(np.clip(upright.min(), -1.0, 1.0)))),
    )


def fly(case: Case, round_trip_ms: float) -> Merit | None:
    """Fly a case in simulated time; return how it went."""
    with TemporaryDirectory() as folder:
        plan = FlightPlan.of_options(
            Path(folder),
            track=case.track,
            profile="flight",
            link="direct",
            latency=0.5 * round_trip_ms,
            start=case.start,
            duration=case.duration_s,
        )
        try:
            fly_locally(plan)
            return merit(read_recording(plan), case)
        except InFlightError:
            return None


def sweep(round_trips_ms: Sequence[float]) -> list[Point]:
    """Fly both cases at each round trip."""
    return [Point(ms, fly(STEP, ms), fly(LEMNISCATE, ms)) for ms in round_trips_ms]


def page(points: Sequence[Point]) -> str:
    """Return the page."""
    headings = ("round trip (ms)", "step: RMS (m)", "overshoot (m)", "tilt (°)", "lemniscate: RMS (m)", "tilt (°)")
    rows = [(f"{point.round_trip_ms:g}", *_step_cells(point.step), *_track_cells(point.lemniscate)) for point in points]
    return _HEAD + markdown(headings, rows, names=1) + "\n" + _margin(points) + "\n"


def _margin(points: Sequence[Point]) -> str:
    """Say how far it is flown well, and how far at all: up to the first round trip that is not."""
    settles = _until(points, [point.step is not None and point.step.rms_m < SETTLED_M for point in points])
    flies = _until(points, [point.step is not None for point in points])
    tracks = _until(points, [point.lemniscate is not None for point in points])
    settled = f"The step settles to within {100.0 * SETTLED_M:g} cm up to a round trip of {settles:g} ms."
    kept = f"The vehicle is kept up to {flies:g} ms in hover, and {tracks:g} ms on the lemniscate."
    return f"{settled}\n{kept} A control sample is 8 ms.\n\nThe same over UDP, unsimulated: [realtime.md](realtime.md)."


def _until(points: Sequence[Point], well: Sequence[bool]) -> float:
    count = well.index(False) if False in well else len(well)
    return points[count - 1].round_trip_ms if count else float("nan")


def _step_cells(it: Merit | None) -> tuple[str, str, str]:
    return ("lost",) * 3 if it is None else (f"{it.rms_m:.2g}", f"{it.overshoot_m:.3f}", f"{it.tilt_deg:.0f}")


def _track_cells(it: Merit | None) -> tuple[str, str]:
    return ("lost",) * 2 if it is None else (f"{it.rms_m:.3g}", f"{it.tilt_deg:.0f}")


def draw(points: Sequence[Point], path: Path) -> None:
    """Draw errors, overshoot and tilt over the round trip."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    errors, tilts = figure.subplots(2, 1, sharex=True)
    for name, color in (("step", "#0072B2"), ("lemniscate", "#D55E00")):
        flown = [(point.round_trip_ms, it) for point in points if (it := getattr(point, name)) is not None]
        lost = [point.round_trip_ms for point in points if getattr(point, name) is None]
        times = [ms for ms, _ in flown]
        errors.plot(times, [max(it.rms_m, 1e-7) for _, it in flown], "o-", color=color, label=f"{name}: RMS")
        if name == "step":
            errors.plot(
                times, [max(it.overshoot_m, 1e-7) for _, it in flown], "o:", color=color, label="step: overshoot"
            )
        tilts.plot(times, [it.tilt_deg for _, it in flown], "o-", color=color, label=name)
        for axes, where in ((errors, 0.93), (tilts, 0.9)):
            heights = [where if name == "step" else where - 0.07] * len(lost)
            axes.plot(lost, heights, "x", color=color, transform=axes.get_xaxis_transform(), label=f"{name}: lost")
    errors.set_yscale("log")
    errors.set_ylabel("error (m)")
    tilts.set_ylabel("largest tilt (°)")
    tilts.set_xlabel("round trip (ms)")
    for axes in (errors, tilts):
        axes.grid(**GRID)
        axes.legend(fontsize=8, loc="center right")
    figure.savefig(path, dpi=110)


def write(folder: Path) -> None:
    """Fly; write page and picture."""
    points = sweep(ROUND_TRIPS_MS)
    (folder / "latency.md").write_text(page(points), encoding="utf-8")
    draw(points, folder / "latency.png")
