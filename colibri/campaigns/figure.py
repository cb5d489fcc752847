"""The figure of a campaign."""

import re
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from colibri.analysis.figures import AXES, GRID, TOP_IN, axes_grid, put_head, put_title, shortened
from colibri.campaigns.factors import is_number
from colibri.campaigns.flight_table import FlightTable, wilson
from colibri.common.spec import fields_of
from colibri.common.types import Array
from colibri.flights.spec import FlightSpec

COLORS = (*(style.color for style in AXES), "#009E73", "#CC79A7", "#D55E00", "#56B4E9", "#999933")
_LOST = "#D00000"
_CONTINUOUS = 3  # least number of values of a factor that is drawn along an axis
_MAX_CURVES, _MAX_STRIPS, _MAX_DRAWN = len(COLORS), 40, 3
_CHARACTER_IN = 0.085  # largest width of a character of a row's name
_WIDE_SPREAD = 20.0  # ratio of largest to smallest value from which the axis is logarithmic
_PANEL_IN, _MAP_IN = 2.6, 3.4

_UNITS = dict(
    n_m="N m", rad_s="rad/s", deg_s="°/s", m_s2="m/s²", m_s="m/s", deg="°", rad="rad", us="µs", ms="ms", mm="mm"
) | dict(m="m", s="s", kg="kg", g="g", hz="Hz", n="N", v="V", ah="Ah", a="A", w="W", percent="%")
"""Of names by how they end, the longest first."""
_WORDS = {"rmse": "RMSE", "qp": "QP", "nees": "NEES", "max": "maximum", "p50": "median", "p99": "99th percentile"}


class _Group(NamedTuple):
    name: str
    at: tuple[float, ...]
    places: list[int]


def draw(table: FlightTable, metric: str | None = None) -> Figure:
    name = metric or table.usual_metric
    values = table.metric(name)
    grid = table.campaign.grid
    numeric = [key for key, each in grid.items() if len(each) >= _CONTINUOUS and all(map(is_number, each))]
    drawn = [key for key in table.campaign.draw if table.factor(key).dtype.kind in "fi"][:_MAX_DRAWN]
    if numeric:
        axes_of = numeric[:2]
        groups = _groups(table, axes_of)
        if len(axes_of) == 2:
            return _heat_map(table, name, values, axes_of, groups)
        if len({group.name for group in groups}) <= _MAX_CURVES:
            return _lines(table, name, values, axes_of[0], groups)
    groups = _groups(table, [])
    if drawn and len(groups) <= _MAX_CURVES:
        return _scatter(table, name, values, drawn, groups)
    return _strips(table, name, values, groups[:_MAX_STRIPS])


def label_of(name: str) -> str:
    """Return a name in words, with its unit: "rmse_after_20s_m" is "RMSE after 20 s (m)"."""
    option = fields_of(FlightSpec).get(name)
    parts, unit = name.split("."), option.option.unit if option else ""
    for place, part in enumerate(parts):
        ending = next((it for it in _UNITS if part.endswith(f"_{it}")), None)
        if ending and not unit:
            parts[place], unit = part.removesuffix(f"_{ending}"), _UNITS[ending]
    text = re.sub(r"\b(\d+)s\b", r"\1 s", ", ".join(parts).replace("_", " "))
    text = re.sub(r"\w+", lambda found: _WORDS.get(found[0], found[0]), text)
    return f"{text} ({unit})" if unit else text


def _groups(table: FlightTable, along: Sequence[str]) -> list[_Group]:
    names = list(table.campaign.grid)
    several = [name for name, values in table.campaign.grid.items() if len(values) > 1 and name not in along]
    columns = {name: table.factor(name) for name in along}
    return [
        _Group(
            ", ".join(shortened(combination[names.index(name)]) for name in several),
            tuple(float(columns[name][places[0]]) for name in along),
            places,
        )
        for combination, places in table.groups().items()
    ]


def _title(table: FlightTable) -> str:
    lost = sum(each.verdict.is_lost for each in table.flown)
    return f"{table.campaign.name}: {len(table.flown)} flights, {lost} lost"


def _flown(table: FlightTable, values: Array, places: Sequence[int]) -> Array:
    found: Array = values[table.through(places)]
    return found[np.isfinite(found)]


def _lines(table: FlightTable, metric: str, values: Array, along: str, groups: Sequence[_Group]) -> Figure:
    figure, ((upper,), (lower,)) = axes_grid(2, 1, TOP_IN, row_in=_PANEL_IN)
    names = list(dict.fromkeys(group.name for group in groups))
    for name, color in zip(names, COLORS, strict=False):
        of_name = sorted((group for group in groups if group.name == name), key=lambda group: group.at)
        through = [(group.at[0], _flown(table, values, group.places)) for group in of_name]
        known = [(at, np.quantile(some, [0.05, 0.5, 0.95])) for at, some in through if len(some)]
        if known:
            at = [each for each, _ in known]
            low, middle, high = np.transpose([quantiles for _, quantiles in known])
            upper.fill_between(at, low, high, color=color, alpha=0.2, linewidth=0)
            upper.plot(at, middle, "o-", color=color, markersize=3.5, linewidth=1.4, label=name)
        shares = [table.lost(group.places)[:2] for group in of_name]
        bounds = [wilson(*share) for share in shares]
        at = [group.at[0] for group in of_name]
        lower.fill_between(at, *np.transpose(bounds), color=color, alpha=0.2, linewidth=0)
        lower.plot(at, [lost / of if of else np.nan for lost, of in shares], "o-", color=color, markersize=3.5)
    upper.set_ylabel(f"{label_of(metric)}\nmedian, 5 to 95 %")
    scale_values(upper, values)
    lower.set_ylabel("share lost\nwith its 95 % interval")
    lower.set_ylim(-0.03, 1.03)
    lower.set_xlabel(label_of(along))
    _scale_factor(lower, [group.at[0] for group in groups])
    for axes in (upper, lower):
        axes.grid(**GRID)
    put_head(figure, _title(table), columns=min(len(names), 3))
    return figure


def _heat_map(table: FlightTable, metric: str, values: Array, along: Sequence[str], groups: Sequence[_Group]) -> Figure:
    names = list(dict.fromkeys(group.name for group in groups))[:_MAX_CURVES]
    xs, ys = (sorted({group.at[axis] for group in groups}) for axis in (0, 1))
    figure, grid = axes_grid(len(names), 1, 0.6, row_in=_MAP_IN, share=False)
    figure.subplots_adjust(hspace=0.35)
    for name, (axes,) in zip(names, grid, strict=True):
        medians, lost = np.full((len(ys), len(xs)), np.nan), np.zeros((len(ys), len(xs)), dtype=bool)
        for group in groups:
            if group.name == name:
                cell = ys.index(group.at[1]), xs.index(group.at[0])
                some = _flown(table, values, group.places)
                medians[cell] = np.median(some) if len(some) else np.nan
                lost[cell] = 2 * table.lost(group.places)[0] > len(group.places)
        edges = np.arange(len(xs) + 1), np.arange(len(ys) + 1)
        image = axes.pcolormesh(*edges, medians, cmap="viridis", norm="log" if _is_wide(medians) else "linear")
        figure.colorbar(image, ax=axes, label=f"{label_of(metric)}, median")
        crosses = np.argwhere(lost)
        axes.plot(crosses[:, 1] + 0.5, crosses[:, 0] + 0.5, "x", color=_LOST, label="more than half lost")
        for axis, numbers, label in ((axes.xaxis, xs, along[0]), (axes.yaxis, ys, along[1])):
            axis.set_major_locator(MaxNLocator(10, integer=True))
            shown = range(0, len(numbers), max(1, len(numbers) // 8))
            axis.set_ticks([place + 0.5 for place in shown], [f"{numbers[place]:.4g}" for place in shown])
            axis.set_label_text(label_of(label))
        axes.set_title(name, fontsize="medium", loc="left")
    note = "; crosses: more than half lost" if any(each.verdict.is_lost for each in table.flown) else ""
    put_title(figure, _title(table) + note)
    return figure


def _scatter(table: FlightTable, metric: str, values: Array, drawn: Sequence[str], groups: Sequence[_Group]) -> Figure:
    figure, grid = axes_grid(len(drawn), 1, TOP_IN, row_in=_PANEL_IN, share=False)
    figure.subplots_adjust(hspace=0.3)
    for factor, (axes,) in zip(drawn, grid, strict=True):
        at = table.factor(factor).astype(np.float64)
        for group, color in zip(groups, COLORS, strict=False):
            through = table.through(group.places)
            axes.plot(at[through], values[through], "o", color=color, markersize=4, alpha=0.6, mew=0, label=group.name)
            lost = [place for place in group.places if table.flown[place].verdict.is_lost]
            edge = axes.get_xaxis_transform()
            if lost:
                axes.plot(at[lost], [0.97] * len(lost), "x", color=color, markersize=5, transform=edge)
        scale_values(axes, values)
        axes.set_ylabel(label_of(metric))
        axes.set_xlabel(label_of(factor))
        axes.grid(**GRID)
    put_head(figure, _title(table), columns=min(len(groups) + 1, 3))
    return figure


def _strips(table: FlightTable, metric: str, values: Array, groups: Sequence[_Group]) -> Figure:
    figure, ((axes,),) = axes_grid(1, 1, 0.6, row_in=0.35 + 0.34 * len(groups))
    name_rows(figure, [axes], [group.name or table.campaign.name for group in groups])
    for place, group in enumerate(groups):
        some = _flown(table, values, group.places)
        color = COLORS[place % len(COLORS)]
        axes.plot(some, np.full(len(some), -place), "o", color=color, markersize=3.5, alpha=0.45, markeredgewidth=0)
        if len(some):
            axes.plot([np.median(some)] * 2, [-place - 0.25, -place + 0.25], color="#000000", linewidth=2.0)
        lost, _, refused = table.lost(group.places)
        said = ", ".join(f"{count} {what}" for count, what in ((lost, "lost"), (refused, "refused")) if count)
        axes.text(0.99, -place, said, transform=axes.get_yaxis_transform(), ha="right", va="center", color=_LOST)
    if _is_wide(values):
        axes.set_xscale("log")
    axes.set_xlabel(f"{label_of(metric)}; bars: medians")
    put_title(figure, _title(table))
    return figure


def make_room_for_names(figure: Figure, names: Iterable[str]) -> None:
    left_in = 0.3 + _CHARACTER_IN * max(len(line) for name in names for line in name.split("\n"))
    figure.subplots_adjust(left=min(0.6, left_in / figure.get_figwidth()))


def name_rows(figure: Figure, panels: Iterable[Axes], names: Sequence[str]) -> None:
    """Name the rows of panels, at y = 0, -1, ..., with a grid across them."""
    make_room_for_names(figure, names)
    for axes in panels:
        axes.set_yticks([-place for place in range(len(names))], names)
        axes.set_ylim(-len(names) + 0.4, 0.6)
        axes.grid(axis="x", **GRID)


def _is_wide(values: Array) -> bool:
    known = values[np.isfinite(values)]
    return len(known) > 0 and float(known.min()) > 0.0 and float(known.max() / known.min()) > _WIDE_SPREAD


def scale_values(axes: Axes, values: Array) -> None:
    if _is_wide(values):
        axes.set_yscale("log")
    else:
        axes.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)


def _scale_factor(axes: Axes, at: Sequence[float]) -> None:
    numbers: Any = np.unique(at)
    is_positive = len(numbers) > _CONTINUOUS and numbers[0] > 0.0
    if is_positive and np.ptp(np.diff(np.log(numbers))) < 0.1 * np.ptp(np.diff(numbers)):
        axes.set_xscale("log")
