"""Tables of `latency.md` and `latency.png`: flights over ever slower links."""

from collections.abc import Iterator, Sequence
from math import pi
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from colibri.analysis.estimation import rms
from colibri.analysis.figures import GRID
from colibri.analysis.outcome import fly_to_its_end
from colibri.analysis.recording import Recording, read_recording
from colibri.analysis.tables import markdown
from colibri.campaigns.engines import in_order
from colibri.flights.plan import FlightPlan
from colibri.flights.spec import FlightSpec
from tools.pages.tables import with_tables

LAWS = ("lpv-mpc", "geometric-se3")
ROUND_TRIPS_MS = (0, 4, 8, 12, 16, 20, 24, 30, 40, 50, 60, 80, 100)
_SHOWN_MS = (0, 8, 16, 24, 40, 60, 100)  # in the tables; the figure has all of them
LOST_M = 5.0
_WRONG_MS = 5.0
_SETTLED = 3.0  # factor on the error without delay, and an error, that are still good
_WELL_M = 1e-3


class LatencyCase(NamedTuple):
    name: str
    track: str
    start: dict[str, float]
    duration_s: float
    judged_from_s: float


STEP = LatencyCase("step", "hover:height=10", {"x": 1.0, "y": 0.0, "z": 10.0}, 12.0, 8.0)
_SPEED_M_S = 4.0 * 2.0 * pi / 6.0
_ON_IT = {"x": 0.0, "y": 0.0, "z": 10.0, "vx": _SPEED_M_S, "vy": _SPEED_M_S}
LEMNISCATE = LatencyCase("lemniscate", "lemniscate:height=10", _ON_IT, 20.0, 8.0)


class SweepPoint(NamedTuple):
    """RMS errors, m, of both flights at a round trip; `None` if lost."""

    law: str
    way: str
    round_trip_ms: float
    step: float | None
    lemniscate: float | None


WAYS = {"not": "not compensated", "measured": "measured", "- 5": "set 5 ms too short", "+ 5": "set 5 ms too long"}
"""Compensated or not, and by what delay."""


def told_ms(way: str, round_trip_ms: float) -> float | None:
    told = {"not": 0.0, "measured": None, "- 5": round_trip_ms - _WRONG_MS, "+ 5": round_trip_ms + _WRONG_MS}[way]
    return None if told is None else max(told, 0.0)


def merit(recording: Recording, case: LatencyCase) -> float | None:
    """Return the RMS error from `judged_from_s` on, m, unless lost."""
    error, t = recording.position_error_m, recording["t"]
    upright = np.cos(recording["phi"]) * np.cos(recording["theta"])
    judged = t >= case.judged_from_s
    if t[-1] < case.duration_s - 0.1 or error.max() > LOST_M or upright[judged].min() < 0.0:
        return None
    return rms(error[judged])


def fly(law: str, case: LatencyCase, round_trip_ms: float, told: float | None) -> float | None:
    """Fly with a delay to compensate, ms, `None` to measure it; return the merit."""
    link: dict[str, Any] = {"link": "direct", "latency": 0.5 * round_trip_ms, "delay": told}
    spec = FlightSpec.of(case.track, controller=law, **link, start=case.start, duration=case.duration_s)
    plan = FlightPlan.of(spec)
    outcome = fly_to_its_end(plan)
    return None if outcome.error else merit(read_recording(plan, outcome.log), case)


def sweep(round_trips_ms: Sequence[float]) -> list[SweepPoint]:
    points = [(law, way, ms) for law in LAWS for way in WAYS for ms in round_trips_ms]
    flights = [(law, case, ms, told_ms(way, ms)) for law, way, ms in points for case in (STEP, LEMNISCATE)]
    merits = in_order(lambda flight: fly(*flight), flights, "latency", quiet=False)
    return [
        SweepPoint(*point, *pair)
        for point, pair in zip(points, zip(merits[::2], merits[1::2], strict=True), strict=True)
    ]


def tables(points: Sequence[SweepPoint]) -> Iterator[str]:
    headings = ("round trip (ms)", *(f"{name}: {way}" for name in ("step", "lemniscate") for way in WAYS))
    for law in LAWS:
        flown = sorted({point.round_trip_ms for point in points}.intersection(_SHOWN_MS))
        yield markdown(headings, [_row(points, law, ms) for ms in flown], names=1)
        limits = []
        for way, name in WAYS.items():
            those = [point for point in points if point.law == law and point.way == way]
            well = _until(those, [_is_well(point, points) for point in those])
            kept = [point.step is not None and point.lemniscate is not None for point in those]
            limits.append((name, well, _until(those, kept)))
        yield markdown(("compensation", "good up to", "not lost up to"), limits, names=1)


def _row(points: Sequence[SweepPoint], law: str, ms: float) -> tuple[str, ...]:
    those = {point.way: point for point in points if point.law == law and point.round_trip_ms == ms}
    errors = [getattr(those[way], name) for name in ("step", "lemniscate") for way in WAYS]
    return f"{ms:g}", *("lost" if error is None else f"{error:.2g}" for error in errors)


def _is_well(point: SweepPoint, points: Sequence[SweepPoint]) -> bool:
    """Whether the errors are at most three times those without delay."""
    first = next(it for it in points if (it.law, it.way, it.round_trip_ms) == (point.law, "not", 0))
    if point.step is None or point.lemniscate is None or first.step is None or first.lemniscate is None:
        return False
    both = (point.step, first.step), (point.lemniscate, first.lemniscate)
    return all(flown <= max(_SETTLED * at_once, _WELL_M) for flown, at_once in both)


def _until(points: Sequence[SweepPoint], well: Sequence[bool]) -> str:
    count = well.index(False) if False in well else len(well)
    return f"{points[count - 1].round_trip_ms:g} ms" if count else "none"


_COLORS = dict(zip(WAYS, ("#555555", "#0072B2", "#D55E00", "#009E73"), strict=True))
_FLOOR_M = 1e-7


def draw(points: Sequence[SweepPoint], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, 6.0), layout="constrained")
    grid = figure.subplots(2, len(LAWS), sharex=True, sharey="row")
    for column, law in enumerate(LAWS):
        for row, name in enumerate(("step", "lemniscate")):
            axes = grid[row][column]
            for height, way in enumerate(WAYS):
                those = [(p.round_trip_ms, getattr(p, name)) for p in points if (p.law, p.way) == (law, way)]
                flown = [(ms, max(it, _FLOOR_M)) for ms, it in those if it is not None]
                lost = [ms for ms, it in those if it is None]
                style = {"ms": 4, "color": _COLORS[way], "label": WAYS[way]}
                axes.plot(*zip(*flown, strict=True), "o-", **style) if flown else None
                heights = [0.97 - 0.04 * height] * len(lost)
                axes.plot(lost, heights, "x", ms=5, color=_COLORS[way], transform=axes.get_xaxis_transform())
            axes.set_yscale("log")
            axes.set_title(f"{law}: {name} (x: lost)", fontsize=10)
            axes.grid(**GRID)
        grid[1][column].set_xlabel("round trip (ms)")
    for row in grid:
        row[0].set_ylabel("error, RMS (m)")
    names = grid[1][0].get_legend_handles_labels()
    figure.legend(*names, loc="outside upper left", ncols=len(WAYS), fontsize=9, frameon=False)
    figure.savefig(path, dpi=110)


def write(folder: Path) -> None:
    points = sweep(ROUND_TRIPS_MS)
    path = folder / "latency.md"
    path.write_text(with_tables(path.read_text(encoding="utf-8"), tables(points)), encoding="utf-8")
    draw(points, folder / "latency.png")
