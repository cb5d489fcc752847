"""Figures of a tuning."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from colibri.analysis.figures import GRID, TOP_IN, axes_grid, put_head, round_ticks
from colibri.campaigns.factors import Choice, LogUniform, shown
from colibri.campaigns.figure import COLORS, name_rows, scale_values
from colibri.tuning.definition import Range
from colibri.tuning.trials import FinishedTrial

_TRIED, _PRUNED, _BEST, _AS_IT_IS = "#0072B2", "#999999", "#D55E00", "#000000"
_BAR_IN, _PANEL_IN = 0.32, 1.9
_COLUMNS = 2
_MANY_DECADES = 300.0


def short_names(names: Sequence[str]) -> dict[str, str]:
    """Remove the tables that all names share."""
    parts = [name.split(".") for name in names]
    shared = 0
    while all(len(each) > shared + 1 and each[shared] == parts[0][shared] for each in parts):
        shared += 1
    return {name: ".".join(each[shared:]) for name, each in zip(names, parts, strict=True)}


def draw_importance(title: str, importances: Mapping[str, Mapping[str, float]]) -> Figure:
    first = next(iter(importances.values()))
    names = sorted(first, key=lambda name: -first[name])
    figure, ((axes,),) = axes_grid(1, 1, TOP_IN, row_in=0.3 + _BAR_IN * len(names) * len(importances))
    short = short_names(names)
    name_rows(figure, [axes], [short[name] for name in names])
    height = 0.8 / len(importances)
    for place, (objective, parts) in enumerate(importances.items()):
        at = -np.arange(len(names)) + 0.4 - height * (place + 0.5)
        widths = [100.0 * parts[name] for name in names]
        bars = axes.barh(at, widths, height, color=COLORS[place % len(COLORS)], label=objective)
        axes.bar_label(bars, fmt="%.0f %%", padding=3)
    axes.set_xlim(0.0, 1.12 * max(100.0 * max(parts.values()) for parts in importances.values()) or 1.0)
    axes.set_xlabel("importance for being in the best quarter of trials (%), PED-ANOVA")
    axes.set_axisbelow(True)
    put_head(figure, title, columns=min(len(importances), 2))
    return figure


def draw_slices(
    title: str, space: Mapping[str, Range], objective: str, trials: Sequence[FinishedTrial], best: FinishedTrial
) -> Figure:
    """Draw the first objective over each number, one dot per trial."""
    names = list(space)
    rows = -(-len(names) // _COLUMNS)
    figure, grid = axes_grid(rows, _COLUMNS, TOP_IN, row_in=_PANEL_IN, share=False)
    figure.subplots_adjust(hspace=0.42)
    cells = [axes for row in grid for axes in row]
    short = short_names(names)
    for name, axes in zip(names, cells, strict=False):
        values = space[name]
        _dots(axes, trials, best, lambda trial, of=name, within=values: _at(within, trial.params[of]), 0)
        if isinstance(values, LogUniform):
            _scale_by_ratios(axes)
        elif isinstance(values, Choice):
            axes.set_xticks(range(len(values.values)), [shown(each) for each in values.values])
        axes.set_xlabel(short[name])
        axes.grid(**GRID)
    for axes in cells[len(names) :]:
        axes.set_visible(False)
    for row in grid:
        row[0].set_ylabel(objective, fontsize="small")
    put_head(figure, title)
    return figure


def draw_history(title: str, objectives: Sequence[str], trials: Sequence[FinishedTrial], best: FinishedTrial) -> Figure:
    """Draw each objective over the trials, and its minimum so far."""
    figure, grid = axes_grid(len(objectives), 1, TOP_IN, row_in=2.6)
    for place, (objective, (axes,)) in enumerate(zip(objectives, grid, strict=True)):
        _dots(axes, trials, best, lambda trial: float(trial.number), place)
        least = np.minimum.accumulate([trial.values[place] for trial in trials])
        numbers = [trial.number for trial in trials]
        axes.step(numbers, least, where="post", color=_BEST, linewidth=1.2, label="least until then")
        axes.set_ylabel(objective)
        axes.grid(**GRID)
    grid[-1][0].set_xlabel("trial")
    grid[-1][0].xaxis.set_major_locator(round_ticks(8))
    put_head(figure, title)
    return figure


def draw_pareto(
    title: str,
    objectives: Sequence[str],
    trials: Sequence[FinishedTrial],
    front: Sequence[FinishedTrial],
    best: FinishedTrial,
) -> Figure:
    figure, grid = axes_grid(len(objectives) - 1, 1, TOP_IN, row_in=3.6, share=False)
    joined = sorted(front, key=lambda trial: trial.values)
    for place, (objective, (axes,)) in enumerate(zip(objectives[1:], grid, strict=True), start=1):
        if len(objectives) == 2:
            axes.plot(
                [trial.values[0] for trial in joined],
                [trial.values[place] for trial in joined],
                color=_TRIED,
                linewidth=1.2,
                drawstyle="steps-post",
            )
        _dots(axes, trials, best, lambda trial: trial.values[0], place, front=front)
        axes.set_xlabel(objectives[0])
        axes.set_ylabel(objective)
        axes.grid(**GRID)
    put_head(figure, title)
    return figure


def _dots(
    axes: Axes,
    trials: Sequence[FinishedTrial],
    best: FinishedTrial,
    along: Any,
    place: int,
    front: Sequence[FinishedTrial] | None = None,
) -> None:
    first = trials[0]
    strong = [trial for trial in trials if not trial.pruned and (front is None or trial in front)]
    weak = [trial for trial in trials if trial not in strong]
    said = "pruned, as expected by then" if front is None else "dominated"
    for some, color, label in ((weak, _PRUNED, said), (strong, _TRIED, "trial" if front is None else "Pareto front")):
        if some:
            at = [along(trial) for trial in some]
            values = [trial.values[place] for trial in some]
            axes.plot(at, values, "o", color=color, markersize=4.5, alpha=0.7, markeredgewidth=0, label=label)
    axes.plot(along(first), first.values[place], "D", color=_AS_IT_IS, markersize=6, label="profile as it is")
    axes.plot(along(best), best.values[place], "*", color=_BEST, markersize=11, label="chosen")
    scale_values(axes, np.array([trial.values[place] for trial in trials]))


def _scale_by_ratios(axes: Axes) -> None:
    axes.set_xscale("log")
    low, high = axes.get_xlim()
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 3.0) if high < _MANY_DECADES * low else (1.0,)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())


def _at(values: Range, value: Any) -> float:
    return [shown(each) for each in values.values].index(value) if isinstance(values, Choice) else float(value)
