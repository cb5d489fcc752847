"""`colibri figures`: the thesis's result figures, flown anew."""

import argparse
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from matplotlib.figure import Figure
from rich.console import Console

from colibri.analysis.figure_series import POSITION, FigureSeries, Series
from colibri.analysis.figures import (
    ANGLES,
    INPUTS,
    Panel,
    TimeFigure,
    draw_times,
    draw_trajectory,
    followed,
    write_figure,
)
from colibri.analysis.outcome import keep_flight
from colibri.campaigns.engines import in_order
from colibri.common.process.lifecycle import fail
from colibri.flights.folder import make_folder, prepare
from colibri.flights.in_process import fly_locally
from colibri.flights.plan import FlightPlan
from colibri.flights.provenance import write_provenance
from colibri.flights.spec import FlightSpec

FORMATS = ("png", "svg")
FIRST_SECONDS = (0.0, 5.0)


class ThesisFlight(NamedTuple):
    name: str
    track: str
    controller: str
    title: str


class ThesisFigure(NamedTuple):
    """A figure: its number, flight, and kind of plot."""

    number: str
    flight: str
    kind: str


FLIGHTS = (
    ThesisFlight("global", "spiral", "global-lpv-mpc", "Spiral, global LPV-MPC"),
    ThesisFlight("spiral", "spiral", "cascade", "Spiral"),
    ThesisFlight("expanding-spiral", "expanding-spiral", "cascade", "Expanding spiral"),
    ThesisFlight("line", "line", "cascade", "Line"),
    ThesisFlight("wave", "wave", "cascade", "Wave"),
    ThesisFlight("crown", "crown", "cascade", "Crown"),
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
    wanted = _wanted(args.only)
    flights = [flight for flight in FLIGHTS if any(figure.flight == flight.name for figure in wanted)]
    make_folder(args.out)
    jobs = [(flight, [figure for figure in wanted if figure.flight == flight.name], args.out) for flight in flights]
    written = in_order(lambda job: draw(*job), jobs, "flights", quiet=args.quiet)
    if not args.quiet:
        Console().print(f"{sum(map(len, written))} files in {args.out}")
    return 0


def draw(flight: ThesisFlight, figures: Sequence[ThesisFigure], out: Path) -> list[Path]:
    """Fly once and draw the figures of that flight."""
    folder = out / "flights" / flight.name
    prepare(folder)
    plan = FlightPlan.of(
        FlightSpec.of(flight.track, profile="thesis", controller=flight.controller, link="direct", out=folder)
    )
    write_provenance(plan)
    summary = fly_locally(plan)
    flown = FigureSeries(plan, summary.frames)
    keep_flight(plan, summary, flown.add)
    series = flown.over_time()
    paths = []
    for figure in figures:
        title = f"{figure.number}  {flight.title}: {KINDS[figure.kind].subject}"
        name = f"{figure.number}-{figure.flight}-{figure.kind}"
        paths += write_figure(KINDS[figure.kind].plot(series, title), out / name, FORMATS)
    return paths


class PlotKind(NamedTuple):
    """Subject of a plot in titles, and its function."""

    subject: str
    plot: Callable[[Series, str], Figure]


def over_time(rows: Iterable[tuple[Panel, ...]]) -> Callable[[Series, str], Figure]:
    figure = TimeFigure("", "", tuple(rows))
    return lambda series, title: draw_times(series, figure, title)


_COORDINATES = {axis: (followed(axis, f"{axis} (m)"), followed(f"v{axis}", f"{axis}' (m/s)")) for axis in POSITION}
KINDS = {
    "trajectory": PlotKind("trajectory", draw_trajectory),
    "position": PlotKind("position and velocity", over_time(_COORDINATES.values())),
    **{
        axis: PlotKind(f"{axis} and its velocity", over_time((panel,) for panel in panels))
        for axis, panels in _COORDINATES.items()
    },
    "angles": PlotKind("angles", over_time((panel,) for panel in ANGLES)),
    "first-seconds": PlotKind(
        "angles, first seconds", over_time((panel._replace(span_s=FIRST_SECONDS),) for panel in ANGLES)
    ),
    "inputs": PlotKind("thrust and moments", over_time((panel,) for panel in INPUTS)),
}


def _wanted(only: list[str] | None) -> list[ThesisFigure]:
    known = [figure.number for figure in FIGURES]
    for number in only or ():
        if number not in known:
            fail(f'unknown figure "{number}" (choose 4.1 to 4.11 or A.1 to A.24)')
    return [figure for figure in FIGURES if only is None or figure.number in only]
