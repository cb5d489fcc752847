"""The left panel; user actions go into a queue."""

from collections.abc import Callable, Sequence
from html import escape
from itertools import cycle
from queue import SimpleQueue
from typing import Any, NamedTuple

import numpy as np
import viser
from viser import uplot

from colibri.common.types import Array, Vector
from colibri.view.page.scene import COLOURS, LAYERS
from colibri.view.page.server import Token
from colibri.view.recorded.playback import SPEEDS
from colibri.view.snapshot import Chart, Snapshot

_STYLE = "margin:0 0.75rem 0.75rem;font-size:0.875rem;line-height:1.55;overflow-wrap:anywhere"


class Done(NamedTuple):
    what: str
    value: Any = None


class ControlPanel:
    """The left panel; a live vehicle has no time line."""

    def __init__(self, gui: viser.GuiApi, span_s: tuple[float, float] | None, scale: float) -> None:
        self.done: SimpleQueue[Done] = SimpleQueue()
        self._words = gui.add_html("")
        self._play: viser.GuiButtonHandle | None = None
        self._slider: viser.GuiSliderHandle[float] | None = None
        if span_s is not None:
            self._add_player(gui, span_s)
        self._boxes: dict[str, viser.GuiInputHandle[bool]] = {}
        self._add_layers(gui, scale)

    @property
    def layers(self) -> frozenset[str]:
        return frozenset(name for name, box in self._boxes.items() if box.value)

    def show(self, text: str, time_s: float, plays: bool) -> None:
        if self._words.content != text:
            self._words.content = text
        if self._slider is not None and self._play is not None:
            self._slider.value = round(time_s, 2)  # type: ignore[misc]  # has a setter that types do not know
            label = "Pause" if plays else "Play"
            if self._play.label != label:
                self._play.label = label

    def _add_player(self, gui: viser.GuiApi, span_s: tuple[float, float]) -> None:
        self._play = gui.add_button("Play")
        begin_s, end_s = (round(time_s, 2) for time_s in span_s)
        self._slider = slider = gui.add_slider("Time, s", begin_s, max(end_s, begin_s + 0.01), 0.01, begin_s)
        speed = gui.add_button_group("Speed", SPEEDS)
        self._play.on_click(lambda _: self.done.put(Done("play")))
        slider.on_update(lambda event: self._by_hand(event, Done("seek", slider.value)))
        speed.on_click(lambda _: self.done.put(Done("speed", speed.value)))

    def _add_layers(self, gui: viser.GuiApi, scale: float) -> None:
        with gui.add_folder("Show", expand_by_default=False):
            for name in LAYERS:
                self._boxes[name] = box = gui.add_checkbox(name, initial_value=True)
                box.on_update(lambda _: self.done.put(Done("layers")))
            size = gui.add_slider("Vehicle size", 1.0, max(40.0, scale), 0.1, scale)
            size.on_update(lambda event: self._by_hand(event, Done("scale", size.value)))
        follow = gui.add_checkbox("Follow the vehicle", initial_value=False)
        follow.on_update(lambda event: self._by_hand(event, Done("follow", follow.value)))

    def _by_hand(self, event: viser.GuiEvent[Any], done: Done) -> None:
        if event.client_id is not None:
            self.done.put(done)


def words(names: Sequence[str], snapshots: Sequence[Snapshot]) -> str:
    """Return HTML; names and texts are escaped."""
    return "".join(
        _of_one(name, "#{:02x}{:02x}{:02x}".format(*COLOURS[number % len(COLOURS)]), now)
        for number, (name, now) in enumerate(zip(names, snapshots, strict=True))
    )


def _of_one(name: str, colour: str, now: Snapshot) -> str:
    speed = float(np.linalg.norm(now.velocity_enu_m_s))
    east, north, up = now.position_enu_m
    armed = {True: "armed", False: "disarmed", None: ""}[now.armed]
    facts = [
        f"t {now.time_s:.2f} s",
        f"E {east:.2f} N {north:.2f} U {up:.2f} m",
        f"{speed:.1f} m/s" if np.isfinite(speed) else "",
        now.battery,
    ]
    error = float(np.linalg.norm(np.subtract(now.position_enu_m, now.reference_enu_m)))
    if np.isfinite(error):
        facts.append(f"error {error:.3f} m")
    lines = [
        f"<b><span style='color:{colour}'>■</span> {_text(name)}</b> "
        f"{_text(' · '.join(filter(None, (now.mode, armed))))}",
        _text(" · ".join(filter(None, facts))),
        *(f"<i>{_text(text)}</i>" for text in now.texts),
    ]
    return f"<p style='{_STYLE}'>{'<br>'.join(lines)}</p>"


def _text(foreign: str) -> str:
    return escape("".join(letter if letter.isprintable() else "\ufffd" for letter in foreign))


ORDERS = {"Arm": "arm", "Disarm": "disarm", "Take off": "take off", "Land": "land", "Return": "return"}
"""Buttons and their commands."""
_HEIGHT_M = 3.0


class CommandPanels:
    """Command panels of all browsers; commands go into `done`."""

    def __init__(
        self,
        server: viser.ViserServer,
        token: Token,
        modes: Callable[[], Sequence[str]],
        done: "SimpleQueue[Done]",
        ground_point: Callable[[Vector, Vector], Vector | None],
    ) -> None:
        self._token = token
        self._modes = modes
        self._done = done
        self._ground_point = ground_point
        self._goes: dict[int, tuple[viser.GuiInputHandle[bool], viser.GuiInputHandle[float]]] = {}
        server.on_client_connect(self._ask)
        server.on_client_disconnect(self._forget)
        server.scene.on_click()(self._clicked)

    def _ask(self, client: viser.ClientHandle) -> None:
        folder = client.gui.add_folder("Commands")
        with folder:
            said = client.gui.add_text("Token", "", hint="as the terminal says it")
            button = client.gui.add_button("Unlock")
            answer = client.gui.add_markdown("")

        def check(_: viser.GuiEvent[Any]) -> None:
            if self._token.matches(said.value):
                folder.remove()
                self._offer(client)
            else:
                answer.content = "That is not the token."

        button.on_click(check)

    def _offer(self, client: viser.ClientHandle) -> None:
        gui = client.gui
        with gui.add_folder("Commands"):
            height = gui.add_number("Height, m", _HEIGHT_M, min=0.5, max=120.0, step=0.5)
            for label, order in ORDERS.items():
                button = gui.add_button(label, color="red" if label == "Disarm" else None)
                self._on_click(button, order, height)
            modes = list(self._modes())
            if modes:
                mode = gui.add_dropdown("Mode", modes)
                change = gui.add_button("Change mode")
                change.on_click(lambda _: self._order("mode", mode.value))
            goes = gui.add_checkbox("Go to: click the ground", initial_value=False)
        self._goes[client.client_id] = (goes, height)

    def _on_click(self, button: viser.GuiButtonHandle, order: str, height: viser.GuiInputHandle[float]) -> None:
        button.on_click(lambda _: self._order(order, float(height.value)))

    def _forget(self, client: viser.ClientHandle) -> None:
        self._goes.pop(client.client_id, None)

    def _clicked(self, event: viser.SceneClickEvent) -> None:
        goes, height = self._goes.get(event.client_id, (None, None))
        if goes is None or height is None or not goes.value:
            return
        place = self._ground_point(event.ray_origin, event.ray_direction)
        if place is not None:
            self._order("go to", (place[0], place[1], place[2] + float(height.value)))

    def _order(self, what: str, value: Any) -> None:
        self._done.put(Done("order", (what, value)))


HEIGHT_PX = 150
_SERIES = ("#1e6ed2", "#e67814", "#28964a", "#963caa", "#c8282d", "#606060")
_LIMIT = "#9a9a9a"
_NOW = "#d01080"
_AXIS_PX = 44
_MARK = "mark"
_UNSEEN = -1e4  # so far below the scale that the line to it is vertical


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
