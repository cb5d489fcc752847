"""Figures of a flight: contents as data, and a function for each kind."""

import gc
import signal
import sys
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from multiprocessing import get_context
from os import getpid
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, ScalarFormatter

from colibri.analysis.figure_series import ATTITUDE, POSITION, START_S, FigureSeries, Series
from colibri.analysis.recording import INPUT, POSITION_REFERENCE, SETTLED_AFTER_S, rotor_names
from colibri.analysis.report import length as in_metres
from colibri.common.process.lifecycle import EXIT_FAILED, end_with, gc_frozen, handle_endings
from colibri.flights.launcher import ready_to_fork
from colibri.flights.plan import FlightPlan

GRID: dict[str, Any] = {"color": "#DDDDDD", "linewidth": 0.6}
_WIDTH_IN, _DPI = 8.6, 150
TOP_IN = 0.8  # room for a title and a row of a legend
_LEFT_IN, _RIGHT_IN, _BOTTOM_IN = 0.85, 0.25, 0.5
_ROW_IN, _ROW_GAP_IN, _COLUMN_GAP_IN = 1.4, 0.2, 0.95
_TITLE_IN, _LABEL_IN = 0.45, 0.6
_TIME_MARGIN = 0.015
_FLATTEST = 0.4
_NOTHING = 1e-12
_PLAIN = (-2, 4)  # powers of ten written without exponent
_PNG_LEVEL = 3  # takes half of the time of the usual 6
_MAX_NAME_CHARS = 36
_ROOM_FOR_TALL = 0.8

Figures: TypeAlias = Mapping[str, Callable[[], Figure]]
"""Functions that draw figures, by name."""


class Style(NamedTuple):
    """Colour, width and dashes of a curve."""

    color: str
    width_pt: float
    dashes: str = "-"


# Okabe and Ito's colours. Lower curves are wider, so that they show beside a coinciding one.
FLOWN = Style("#000000", 1.1)
REFERENCE = Style("#56B4E9", 4.5)
LIMIT = Style("#D55E00", 1.4, "--")
START_COLOR = "#D55E00"
AXES = (Style("#0072B2", 4.0), Style("#E69F00", 2.4), Style("#000000", 1.0))


class Curve(NamedTuple):
    """A series; a `held` one keeps each value since the previous sample."""

    series: str
    label: str
    style: Style = FLOWN
    held: bool = False


class Panel(NamedTuple):
    """Curves over time, the first lowest."""

    quantity: str
    curves: tuple[Curve, ...]
    span_s: tuple[float, float] | None = None
    from_zero: bool = False


class TimeFigure(NamedTuple):
    """Panels over time, row by row."""

    name: str
    subject: str
    rows: tuple[tuple[Panel, ...], ...]


def draw_flight(flown: FigureSeries, plan: FlightPlan) -> list[Path]:
    """Write a flight's figures, half of them by a fork where possible."""
    figures, other = figures_of(flown, plan), None
    own, others = list(figures)[::2], list(figures)[1::2]
    if ready_to_fork():
        other = get_context("fork").Process(target=_draw, args=(figures, others, plan.out, getpid()), daemon=True)
        other.start()
    _draw(figures, own, plan.out)
    if other is not None:
        other.join()
    if other is None or other.exitcode:
        _draw(figures, others, plan.out)
    return [plan.out / f"{name}.png" for name in figures]


def _draw(figures: Figures, names: Iterable[str], folder: Path, parent: int | None = None) -> None:
    if parent is not None:
        handle_endings(signal.SIG_DFL)
        end_with(parent)
    with gc_frozen():
        for name in names:
            try:
                write_figure(figures[name](), folder / name)
            except OSError:
                if parent is None:
                    raise
                sys.exit(EXIT_FAILED)  # the parent tries again, and reports it
            gc.collect()  # a figure is a net of circles, and its pixels take more than all that it shows


def figures_of(flown: FigureSeries, plan: FlightPlan) -> Figures:
    flight = f"{shortened(str(plan.spec.track))}, {plan.flown_by}"
    figures = {"trajectory": partial(draw_trajectory, flown.in_space(), f"{flight}: trajectory")}
    series = flown.over_time()
    for figure in flight_figures(series, plan):
        figures[figure.name] = partial(draw_times, series, figure, f"{flight}: {figure.subject}")
    return figures


def flight_figures(series: Series, plan: FlightPlan) -> tuple[TimeFigure, ...]:
    end_s = float(series["t"][-1])
    start = (0.0, START_S) if end_s >= 2.0 * START_S else None
    settled = (SETTLED_AFTER_S, end_s) if end_s > SETTLED_AFTER_S else None
    position = tuple((followed(axis, f"{axis} (m)"), followed(f"v{axis}", f"v{axis} (m/s)")) for axis in POSITION)
    return (
        TimeFigure("position", "position and velocity", position),
        TimeFigure("attitude", "attitude", beside(ANGLES, start)),
        TimeFigure("inputs", "thrust and moments", beside(INPUTS, start)),
        TimeFigure("rotors", "rotor speeds", beside(_rotor_panels(plan), start)),
        TimeFigure("error", "position error", beside(_error_panels(series), settled)),
    )


def followed(name: str, quantity: str, *, held_reference: bool = False) -> Panel:
    """Return a series above its reference, `<name>_ref`."""
    return Panel(quantity, (Curve(f"{name}_ref", "reference", REFERENCE, held_reference), Curve(name, "flown")))


ANGLES = [followed(name, f"{sign} (°)", held_reference=True) for name, sign in zip(ATTITUDE, "φθψ", strict=True)]
INPUTS = [Panel(f"{name} ({'N' if name == 'U1' else 'N m'})", (Curve(name, "", held=True),)) for name in INPUT]
"""Panels of every flight."""


def beside(panels: Iterable[Panel], span_s: tuple[float, float] | None) -> tuple[tuple[Panel, ...], ...]:
    return tuple((panel, panel._replace(span_s=span_s)) if span_s else (panel,) for panel in panels)


def draw_times(series: Series, description: TimeFigure, title: str) -> Figure:
    labelled = any(curve.label for row in description.rows for panel in row for curve in panel.curves)
    figure, grid = axes_grid(len(description.rows), len(description.rows[0]), TOP_IN if labelled else _TITLE_IN)
    for axes_row, panels in zip(grid, description.rows, strict=True):
        for axes, panel in zip(axes_row, panels, strict=True):
            _draw_panel(axes, series, panel)
    for axes in grid[-1]:
        axes.set_xlabel("t (s)")
    put_head(figure, title)
    return figure


def draw_trajectory(series: Series, title: str) -> Figure:
    figure = Figure(figsize=(_WIDTH_IN, 6.8), dpi=_DPI)
    # Depth sorting would draw the reference over the path in places.
    axes = figure.add_subplot(projection="3d", computed_zorder=False)
    figure.subplots_adjust(left=0.0, right=0.97, bottom=0.03, top=0.93)
    axes.plot(*(series[name] for name in POSITION_REFERENCE), label="reference", **line_style(REFERENCE))
    axes.plot(*(series[name] for name in POSITION), label="flown", **line_style(FLOWN))
    axes.plot(*(series[name][:1] for name in POSITION), "o", label="start", color=START_COLOR, markersize=8)
    to_scale = _scale(axes)
    put_head(figure, title if to_scale else f"{title}, axes not to scale")
    return figure


def shortened(name: str) -> str:
    """Cut the middle of a long name."""
    half = _MAX_NAME_CHARS // 2
    return name if len(name) <= _MAX_NAME_CHARS else f"{name[:half]}…{name[-half:]}"


def write_figure(figure: Figure, path: Path, formats: Iterable[str] = ("png",)) -> list[Path]:
    paths = [path.with_name(f"{path.name}.{suffix}") for suffix in formats]
    for written in paths:
        options = {"pil_kwargs": {"compress_level": _PNG_LEVEL}} if written.suffix == ".png" else {}
        figure.savefig(written, **options)  # type: ignore[arg-type]
    return paths


def _rotor_panels(plan: FlightPlan) -> list[Panel]:
    limits = (Curve("idle", "limits", LIMIT), Curve("fastest", "limits", LIMIT))
    unit = plan.plant_vehicle.rotors.speed_unit
    return [
        Panel(f"Ω{number} ({unit})", (*limits, Curve(name, "rotor speed", held=True)))
        for number, name in enumerate(rotor_names(plan), start=1)
    ]


def _error_panels(series: Series) -> list[Panel]:
    rms = series["rms"][-1]
    label = f"RMS after {SETTLED_AFTER_S:.0f} s: {in_metres(rms)}"
    settled = (Curve("rms", label, REFERENCE),) if np.isfinite(rms) else ()
    axes = tuple(Curve(f"e{axis}", f"error in {axis}", style) for axis, style in zip(POSITION, AXES, strict=True))
    distance = (*settled, Curve("distance", ""))
    return [Panel("distance (m)", distance, from_zero=True), Panel("error (m)", axes)]


def axes_grid(
    rows: int, columns: int, top_in: float, row_in: float = _ROW_IN, *, share: bool = True
) -> tuple[Figure, list[list[Axes]]]:
    height_in = top_in + rows * row_in + (rows - 1) * _ROW_GAP_IN + _BOTTOM_IN
    figure = Figure(figsize=(_WIDTH_IN, height_in), dpi=_DPI)
    column_in = (_WIDTH_IN - _LEFT_IN - _RIGHT_IN - (columns - 1) * _COLUMN_GAP_IN) / columns
    grid = figure.subplots(rows, columns, sharex="col" if share else "none", squeeze=False)
    figure.subplots_adjust(
        left=_LEFT_IN / _WIDTH_IN,
        right=1.0 - _RIGHT_IN / _WIDTH_IN,
        bottom=_BOTTOM_IN / height_in,
        top=1.0 - top_in / height_in,
        wspace=_COLUMN_GAP_IN / column_in,
        hspace=_ROW_GAP_IN / row_in,
    )
    return figure, [list(axes_row) for axes_row in grid]


def _draw_panel(axes: Axes, series: Series, panel: Panel) -> None:
    t = series["t"]
    begin_s, end_s = panel.span_s or (t[0], t[-1])
    shown = (t >= begin_s) & (t <= end_s)
    for curve in panel.curves:
        steps = "steps-pre" if curve.held else "default"
        axes.plot(t[shown], series[curve.series][shown], label=curve.label, drawstyle=steps, **line_style(curve.style))
    margin_s = _TIME_MARGIN * (end_s - begin_s)
    axes.set_xlim(begin_s - margin_s, end_s + margin_s)
    axes.set_ylabel(panel.quantity)
    axes.yaxis.set_label_coords(-_LABEL_IN / (axes.get_position().width * _WIDTH_IN), 0.5)
    axes.grid(**GRID)
    axes.yaxis.set_major_locator(round_ticks(6))
    axes.yaxis.set_major_formatter(PlainTicks())
    axes.ticklabel_format(axis="y", scilimits=_PLAIN)  # longer labels would reach that of the axis
    if np.ptp(axes.dataLim.intervaly) < _NOTHING:
        axes.set_ylim(-1.0, 1.0)  # otherwise rounding errors fill the panel
    if panel.from_zero:
        axes.set_ylim(0.0, 1.1 * axes.dataLim.y1)


class PlainTicks(ScalarFormatter):
    """Typesets the common power of ten alone, five times as fast as all labels."""

    def get_offset(self) -> str:
        self.set_useMathText(True)
        offset: str = super().get_offset()
        self.set_useMathText(False)
        return offset


def round_ticks(intervals: int) -> MaxNLocator:
    """Return a locator of round numbers, which have short labels."""
    return MaxNLocator(intervals, steps=[1, 2, 5, 10])


def line_style(style: Style) -> dict[str, Any]:
    # Wide lines would otherwise reach past their first and last sample.
    ends = {"solid_capstyle": "butt"}
    return {"color": style.color, "linewidth": style.width_pt, "linestyle": style.dashes} | ends


def put_head(figure: Figure, title: str, columns: int | None = None) -> None:
    """Put title and legend above the axes, each label once."""
    pairs = (axes.get_legend_handles_labels() for axes in figure.axes)
    labelled = {label: handle for handles, labels in pairs for label, handle in zip(labels, handles, strict=True)}
    put_title(figure, title)
    height_in = figure.get_figheight()
    figure.legend(
        labelled.values(),
        labelled.keys(),
        loc="upper left",
        bbox_to_anchor=(0.2 / _WIDTH_IN, 1.0 - 0.38 / height_in),
        ncols=columns or len(labelled),
        frameon=False,
        borderaxespad=0.0,
    )


def put_title(figure: Figure, title: str) -> None:
    top = 1.0 - 0.1 / figure.get_figheight()
    figure.text(0.2 / _WIDTH_IN, top, title, va="top", fontsize="large", fontweight="bold", parse_math=False)


def _scale(axes: Any) -> bool:
    ranges = np.ptp([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()], axis=1)
    ranges /= ranges.max()
    lengths = np.maximum(ranges, _FLATTEST)
    tall = lengths[2] > max(lengths[:2])
    axes.set_box_aspect(lengths, zoom=_ROOM_FOR_TALL if tall else 1.0)
    axes.zaxis.set_tick_params(pad=18 if tall else 8)
    for name, axis, length in zip(POSITION, (axes.xaxis, axes.yaxis, axes.zaxis), lengths, strict=True):
        axis.set_label_text(f"{name} (m)")
        axis.set_major_locator(round_ticks(3 if length < 0.7 else 6))
        axis.labelpad = 32.0 if tall and name == "z" else 18.0
    return bool(ranges.min() >= _FLATTEST)
