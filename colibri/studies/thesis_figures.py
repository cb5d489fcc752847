"""`colibri figures`: fly all that the thesis shows, and draw each of its result figures under its number."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from matplotlib.figure import Figure

from colibri.analysis.figures import (
    ATTITUDE,
    POSITION,
    Curve,
    Panel,
    Series,
    TimeFigure,
    draw_times,
    draw_trajectory,
    flight_series,
    followed,
    write_figure,
)
from colibri.analysis.outcome import keep_flight
from colibri.analysis.parallel import side_by_side
from colibri.analysis.recording import INPUT
from colibri.common.process.lifecycle import fail
from colibri.flights.fly import make_folder, prepare
from colibri.flights.in_process import fly_locally
from colibri.flights.plan import FlightPlan

FORMATS = ("png", "svg")
FIRST_SECONDS = (0.0, 5.0)


class Flight(NamedTuple):
    """A flight that the thesis shows: its name here, the track, the controller, and what titles call it."""

    name: str
    track: str
    controller: str
    title: str


class ThesisFigure(NamedTuple):
    """A figure of the thesis: its number, the flight it shows, and which kind of plot."""

    number: str
    flight: str
    kind: str


FLIGHTS = (
    Flight("global", "spiral", "global-lpv-mpc", "Spiral, global LPV-MPC"),
    Flight("spiral", "spiral", "cascade", "Spiral"),
    Flight("expanding-spiral", "expanding-spiral", "cascade", "Expanding spiral"),
    Flight("line", "line", "cascade", "Line"),
    Flight("wave", "wave", "cascade", "Wave"),
    Flight("crown", "crown", "cascade", "Crown"),
)
_EVERY_TRACK = ("trajectory", "x", "y", "z", "angles", "inputs")
_APPENDIX = ("expanding-spiral", "line", "wave", "crown")
FIGURES = (
    *(
        ThesisFigure(f"4.{i}", "global", kind)
        for i, kind in enumerate(("trajectory", "position", "angles", "inputs"), 1)
    ),
    *(
        ThesisFigure(f"4.{i}", "spiral", kind)
        for i, kind in enumerate(("trajectory", "x", "y", "z", "angles", "first-seconds", "inputs"), 5)
    ),
    *(
        ThesisFigure(f"A.{1 + 6 * track + i}", name, kind)
        for track, name in enumerate(_APPENDIX)
        for i, kind in enumerate(_EVERY_TRACK)
    ),
)


def figures(args: argparse.Namespace) -> int:
    """Draw as the command line says; return the exit code."""
    wanted = _wanted(args.only)
    flights = [flight for flight in FLIGHTS if any(figure.flight == flight.name for figure in wanted)]
    make_folder(args.out)
    jobs = [
        Job(flight, tuple(figure for figure in wanted if figure.flight == flight.name), args.out) for flight in flights
    ]
    written = side_by_side(draw, jobs, "figures", quiet=args.quiet, worth=lambda job: len(job.figures))
    if not args.quiet:
        from rich.console import Console

        Console().print(f"{sum(map(len, written))} files in {args.out}")
    return 0


class Job(NamedTuple):
    """A flight, the figures to draw of it, and where to."""

    flight: Flight
    figures: tuple[ThesisFigure, ...]
    out: Path


def draw(job: Job) -> list[Path]:
    """Fly once and draw the figures of that flight; return what was written."""
    folder = job.out / "flights" / job.flight.name
    prepare(folder)
    plan = FlightPlan.of_track(job.flight.track, folder, profile="thesis", controller=job.flight.controller)
    recording, _ = keep_flight(plan, fly_locally(plan))
    series = flight_series(recording, plan)
    paths = []
    for figure in job.figures:
        title = f"{figure.number}  {job.flight.title}: {KINDS[figure.kind].subject}"
        name = f"{figure.number}-{figure.flight}-{figure.kind}"
        paths += write_figure(KINDS[figure.kind].plot(series, title), job.out / name, FORMATS)
    return paths


class Kind(NamedTuple):
    """A kind of plot: what titles call it, and the function that draws it."""

    subject: str
    plot: Callable[[Series, str], Figure]


def position(series: Series, title: str) -> Figure:
    """Draw all three coordinates and their speeds."""
    rows = tuple((followed(axis, f"{axis} (m)"), followed(f"v{axis}", f"{axis}' (m/s)")) for axis in POSITION)
    return draw_times(series, TimeFigure("", "", rows), title)


def coordinate(axis: str) -> Callable[[Series, str], Figure]:
    """Return the function that draws one coordinate and its speed."""

    def plot(series: Series, title: str) -> Figure:
        rows = ((followed(axis, f"{axis} (m)"),), (followed(f"v{axis}", f"{axis}' (m/s)"),))
        return draw_times(series, TimeFigure("", "", rows), title)

    return plot


def angles(span_s: tuple[float, float] | None) -> Callable[[Series, str], Figure]:
    """Return the function that draws roll, pitch and yaw with their references, in a span of time."""

    def plot(series: Series, title: str) -> Figure:
        panels = (
            followed(name, f"{sign} (°)", held_reference=True)._replace(span_s=span_s)
            for name, sign in zip(ATTITUDE, "φθψ", strict=True)
        )
        return draw_times(series, TimeFigure("", "", tuple((panel,) for panel in panels)), title)

    return plot


def inputs(series: Series, title: str) -> Figure:
    """Draw thrust and moments."""
    panels = (Panel(f"{name} ({'N' if name == 'U1' else 'N m'})", (Curve(name, "", held=True),)) for name in INPUT)
    return draw_times(series, TimeFigure("", "", tuple((panel,) for panel in panels)), title)


KINDS = {
    "trajectory": Kind("trajectory", draw_trajectory),
    "position": Kind("position and velocity", position),
    "x": Kind("x and its velocity", coordinate("x")),
    "y": Kind("y and its velocity", coordinate("y")),
    "z": Kind("z and its velocity", coordinate("z")),
    "angles": Kind("angles", angles(None)),
    "first-seconds": Kind("angles, first seconds", angles(FIRST_SECONDS)),
    "inputs": Kind("thrust and moments", inputs),
}


def _wanted(only: list[str] | None) -> list[ThesisFigure]:
    known = [figure.number for figure in FIGURES]
    for number in only or ():
        if number not in known:
            fail(f"there is no figure {number}: choose 4.1 to 4.11 or A.1 to A.24")
    return [figure for figure in FIGURES if only is None or figure.number in only]
