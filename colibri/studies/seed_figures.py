"""Figure of the errors of many seeds, track by track."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullFormatter

from colibri.analysis.estimation import MEASURED, NAVIGATION, bounds
from colibri.analysis.figures import TOP_IN, axes_grid, put_title, shortened, write_figure
from colibri.analysis.recording import SETTLED_AFTER_S
from colibri.campaigns.figure import name_rows
from colibri.campaigns.flight_table import FlightTable

_LABEL_IN = 0.8
_MAX_DECADES = 12
_NIS_COLORS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9")
_TRUE = "rmse_after_20s_m"
_PANELS: tuple[tuple[str, dict[str, tuple[str, str]]], ...] = (
    ("RMS (m)", {"control_rmse_m": ("#000000", "reference from estimate"), _TRUE: ("#D55E00", "reference from truth")}),
    (
        "RMS (m)",
        {
            "estimation_rmse_m.horizontal": ("#0072B2", "estimate, horizontal"),
            "estimation_rmse_m.vertical": ("#E69F00", "estimate, vertical"),
        },
    ),
    (
        "RMS (°)",
        {
            "attitude_rmse_deg.roll": ("#009E73", "roll"),
            "attitude_rmse_deg.pitch": ("#56B4E9", "pitch"),
            "attitude_rmse_deg.yaw": ("#CC79A7", "yaw"),
        },
    ),
)

_BY_TRUTH = ("RMS (m)", {_TRUE: ("#000000", "off its reference")})
"""The only panel of a flight on the state."""


def draw_seeds(table: FlightTable, out: Path) -> list[Path]:
    """Draw `seeds.png`: a dot a flight, a bar at the median, and bounds."""
    cases = table.groups()
    estimated = not np.isnan(table.metric("estimation_rmse_m.horizontal")).all()
    panels = _PANELS if estimated else (_BY_TRUTH,)
    rows = len(panels) + 2 * estimated
    row_in = 0.35 + 0.42 * len(cases)
    figure, grid = axes_grid(rows, 1, TOP_IN, row_in=row_in + _LABEL_IN, share=False)
    several = len({contender for contender, _ in cases}) > 1
    names = [shortened(f"{track}, {contender}" if several else track) for contender, track in cases]
    name_rows(figure, [axes for (axes,) in grid], names)
    figure.subplots_adjust(hspace=_LABEL_IN / row_in)
    for (axes,), (label, quantities) in zip(grid, panels, strict=False):
        for number, (quantity, (color, called)) in enumerate(quantities.items()):
            _strips(axes, table, quantity, color, called, _shift(number, len(quantities)))
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=_MAX_DECADES))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xlabel(label, loc="right")
    if estimated:
        _draw_nees(grid[-2][0], table)
        _draw_nis(grid[-1][0], table)
    for (axes,) in grid:
        axes.tick_params(labelbottom=True)
        if axes.get_legend_handles_labels()[1]:
            where: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.2}
            axes.legend(**where, ncols=len(MEASURED), frameon=False)
    put_title(figure, f"{len(table.flown)} flights, errors after {SETTLED_AFTER_S:.0f} s; bars: medians")
    return write_figure(figure, out / "seeds")


def _shift(number: int, of: int) -> float:
    return min(0.26, 0.85 / of) * (number - 0.5 * (of - 1))


def _draw_nees(axes: Axes, table: FlightTable) -> None:
    _strips(axes, table, "nees_mean", "#000000", "", 0.0, np.mean)
    within = bounds(NAVIGATION, len(table.campaign.seeds))
    axes.axvspan(*within, color="#D55E00", alpha=0.15, linewidth=0)
    axes.axvline(NAVIGATION, color="#D55E00", linewidth=1.2, label="right; shaded: 95 % of the means over flights")
    axes.set_xlabel("NEES of position, velocity and attitude, mean of a flight; bar: mean of all", loc="right")


def _draw_nis(axes: Axes, table: FlightTable) -> None:
    for number, (kind, numbers) in enumerate(MEASURED.items()):
        shift = _shift(number, len(MEASURED))
        _strips(axes, table, f"nis_mean.{kind}.mean", _NIS_COLORS[number % len(_NIS_COLORS)], kind, shift)
        counts = table.metric(f"nis_mean.{kind}.innovations")
        for place, flights in enumerate(table.groups().values()):
            of_case = counts[table.through(flights)]
            innovations = np.nan_to_num(of_case).max(initial=0.0)
            if innovations:
                for bound in bounds(numbers * innovations, 1):
                    at = [bound / (numbers * innovations)] * 2
                    axes.plot(at, [-place - shift - 0.08, -place - shift + 0.08], color="#000000", linewidth=1.0)
    axes.axvline(1.0, color="#D55E00", linewidth=1.2)
    axes.set_xlabel(
        "NIS in parts of its degrees of freedom, mean of a flight; black: bounds of 95 % of flights", loc="right"
    )


def _strips(
    axes: Axes,
    table: FlightTable,
    metric: str,
    color: str,
    called: str,
    shift: float,
    middle: Callable[[Any], Any] = np.median,
) -> None:
    column = table.metric(metric)
    for place, flights in enumerate(table.groups().values()):
        values = column[table.through(flights)]
        values = values[np.isfinite(values)]
        lost = len(flights) - len(table.through(flights))
        if lost and metric == _TRUE:
            text = f"{lost} lost"
            axes.text(
                0.99, -place, text, transform=axes.get_yaxis_transform(), ha="right", va="center", color="#D00000"
            )
        if not len(values):
            continue
        at = np.full(len(values), -place - shift)
        axes.plot(values, at, "o", color=color, markersize=3, alpha=0.45, markeredgewidth=0, label=called)
        called = ""  # each label once
        axes.plot([middle(values)] * 2, [-place - shift - 0.12, -place - shift + 0.12], color=color, linewidth=2.2)
