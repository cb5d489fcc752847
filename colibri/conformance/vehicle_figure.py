"""The figure of `check-vehicle`: how wrong each number may be."""

from collections.abc import Sequence

from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, NullLocator

from colibri.analysis.figures import TOP_IN, axes_grid, put_head
from colibri.campaigns.figure import name_rows
from colibri.conformance.subject import Result
from colibri.conformance.vehicle_flights import MAX_FACTOR, Bound, Tolerance

FIGURE = "tolerances.png"
_COLORS = {Result.OK: "#0072B2", Result.NEAR: "#D55E00"}
_BAR_IN = 0.4
_ROOM = 2.4  # for the texts beside a bar that reaches the end
_TICKS = (0.25, 0.5, 0.8, 1.0, 1.25, 2.0, 4.0)


def draw_tolerances(title: str, tolerances: Sequence[Tolerance]) -> Figure:
    """Draw a bar for each number, from the smallest to the largest ratio of file and truth."""
    figure, ((axes,),) = axes_grid(1, 1, TOP_IN, row_in=0.3 + _BAR_IN * len(tolerances))
    name_rows(figure, [axes], [each.name for each in tolerances])
    for place, (_, least, most) in enumerate(tolerances):
        result = tolerances[place].result
        label = "near a limit" if result is Result.NEAR else "flown"
        axes.barh(-place, most.factor - least.factor, 0.6, least.factor, color=_COLORS[result], label=label)
        axes.text(least.factor / 1.04, -place, _text(least, "below"), ha="right", va="center", fontsize="small")
        axes.text(most.factor * 1.04, -place, _text(most, "above"), ha="left", va="center", fontsize="small")
    axes.axvline(1.0, color="black", linewidth=1.0)
    axes.set_xscale("log")
    axes.set_xlim(1.0 / (MAX_FACTOR * _ROOM), MAX_FACTOR * _ROOM)
    axes.set_xticks(_TICKS, [f"{tick:g}" for tick in _TICKS])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("number in the file / true number")
    axes.set_axisbelow(True)
    put_head(figure, f"{title}: how wrong each number may be")
    return figure


def _text(bound: Bound, side: str) -> str:
    return f"{bound.how} {side} {bound}" if bound.how else str(bound)
