"""Plots beside the scene."""

from collections.abc import Sequence
from itertools import cycle
from typing import Any

import numpy as np
import viser
from viser import uplot

from colibri.common.types import Array
from colibri.view.page.scene import COLOURS
from colibri.view.snapshot import Chart

HEIGHT_PX = 150
_SERIES = ("#1e6ed2", "#e67814", "#28964a", "#963caa", "#c8282d", "#606060")
_LIMIT = "#9a9a9a"
_NOW = "#d01080"
_AXIS_PX = 44
_MARK = "mark"
_UNSEEN = -1e4
"""So far below the scale that the line to it is vertical."""


class Plots:
    """One plot per title: all series of one vehicle, or the headline of each."""

    def __init__(self, gui: viser.GuiApi, tab: viser.GuiTabHandle, names: Sequence[str], *, marked: bool) -> None:
        self._marked = marked
        self._gui = gui
        self._tab = tab
        self._names = tuple(names)
        self._shown: dict[str, tuple[Any, tuple[Array, ...]]] = {}

    def show(self, charts: Sequence[Sequence[Chart]]) -> None:
        for title in dict.fromkeys(chart.title for of_one in charts for chart in of_one):
            same = [next((chart for chart in of_one if chart.title == title), None) for of_one in charts]
            data, series = self._alone(same[0]) if len(same) == 1 and same[0] else self._overlaid(same)
            if title not in self._shown:
                with self._tab:
                    self._shown[title] = (self._add(title, data, series), data)
            else:
                handle, _ = self._shown[title]
                handle.data = data
                self._shown[title] = (handle, data)

    def mark(self, time_s: float) -> None:
        if not self._marked:
            return
        for handle, data in self._shown.values():
            times_s, *values, _ = data
            handle.data = (times_s, *values, _spike(times_s, time_s))

    def _add(self, title: str, data: tuple[Array, ...], series: tuple[uplot.Series, ...]) -> Any:
        return self._gui.add_uplot(
            data,
            series,
            title=title,
            height=HEIGHT_PX,
            scales={"x": uplot.Scale(time=False), _MARK: uplot.Scale(auto=False, range=(0.0, 1.0))},
            axes=(uplot.Axis(size=28), uplot.Axis(size=_AXIS_PX)),
            legend=uplot.Legend(show=len(series) > 2 + self._marked, live=False),
            cursor=uplot.Cursor(show=True),
            padding=(4, 12, 0, 0),
        )

    def _alone(self, chart: Chart) -> tuple[tuple[Array, ...], tuple[uplot.Series, ...]]:
        colours = cycle(_SERIES)
        lines = tuple(
            uplot.Series(label=name.strip("()"), stroke=_LIMIT, width=1, dash=(4.0, 4.0), points={"show": False})
            if name.startswith("(")
            else uplot.Series(label=name, stroke=next(colours), width=1.3, points={"show": False})
            for name in chart.names
        )
        return self._framed(chart.times_s, list(chart.values), lines)

    def _overlaid(self, charts: Sequence[Chart | None]) -> tuple[tuple[Array, ...], tuple[uplot.Series, ...]]:
        known = [chart for chart in charts if chart is not None]
        times_s = np.unique(np.concatenate([chart.times_s for chart in known]))
        values, lines = [], []
        for number, chart in enumerate(charts):
            if chart is None or not len(chart.times_s):
                continue
            values.append(np.interp(times_s, chart.times_s, chart.headline))
            stroke = "#{:02x}{:02x}{:02x}".format(*COLOURS[number % len(COLOURS)])
            lines.append(uplot.Series(label=self._names[number], stroke=stroke, width=1.3, points={"show": False}))
        return self._framed(times_s, values, tuple(lines))

    def _framed(
        self, times_s: Array, values: list[Array], lines: tuple[uplot.Series, ...]
    ) -> tuple[tuple[Array, ...], tuple[uplot.Series, ...]]:
        seconds = uplot.Series(label="s")
        if not self._marked:
            return (times_s, *values), (seconds, *lines)
        mark = uplot.Series(label="now", scale=_MARK, stroke=_NOW, width=1, points={"show": False})
        return (times_s, *values, _spike(times_s, -np.inf)), (seconds, *lines, mark)


def _spike(times_s: Array, time_s: float) -> Array:
    """Return a line from far below to the top at a time; uPlot cannot scale nan."""
    mark = np.full(len(times_s), _UNSEEN)
    if time_s >= times_s[0]:
        mark[min(int(np.searchsorted(times_s, time_s)), len(times_s) - 1)] = 1.0
    return mark
