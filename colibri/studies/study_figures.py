"""Figures of the studies, one function for each."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import isnan, nan
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

from colibri.analysis.figures import GRID, LIMIT, TOP_IN, Style, axes_grid, line_style, put_head, round_ticks
from colibri.analysis.logs import read_series
from colibri.analysis.lost import LOST_M
from colibri.analysis.outcome import fly_to_its_end
from colibri.analysis.recording import ROTORS, SETTLED_AFTER_S, Recording, read_recording
from colibri.autopilot.control.interface import FALLBACK_CODES, Active, Fallback
from colibri.campaigns.definition import Point
from colibri.campaigns.figure import name_rows
from colibri.campaigns.flights import Common, plan_point
from colibri.common.types import Array
from colibri.flights.plan import FlightPlan
from colibri.mavlink.ulog.flight_topics import TRUTH
from colibri.mavlink.ulog.log import TopicReader

_AWAY_M = 200.0
_GROUNDED_M = 0.1  # a vehicle on its back is lower than that
_SAMPLE_TIME_S = 1e-6


@dataclass(frozen=True, slots=True)
class Flown:
    """A flight; rotor limits are the least speed, and the largest by voltage, (n,)."""

    recording: Recording
    rotor_limits: tuple[float, Array]
    failure: str  # reason of an early end

    @property
    def t(self) -> Array:
        return self.recording["t"]

    @property
    def tilt_deg(self) -> Array:
        """Angle between the body's z axis and the vertical, (n,)."""
        upright = np.cos(self.recording["phi"]) * np.cos(self.recording["theta"])
        angle: Array = np.degrees(np.arccos(np.clip(upright, -1.0, 1.0)))
        return angle

    @property
    def settled(self) -> NDArray[np.bool_]:
        return self.t >= SETTLED_AFTER_S - _SAMPLE_TIME_S

    @property
    def rms_m(self) -> float:
        """RMS of the settled error; nan in a short flight."""
        error = self.recording.position_error_m[self.settled]
        return float(np.sqrt(np.mean(error**2))) if len(error) else nan

    @property
    def max_error_m(self) -> float:
        error = self.recording.position_error_m[self.settled]
        return float(error.max()) if len(error) else nan

    @property
    def lost(self) -> bool:
        return bool(self.failure) or (not isnan(self.max_error_m) and self.max_error_m > LOST_M)

    @property
    def crashed(self) -> bool:
        """Whether it ended early, came down, or flew away."""
        came_down = float(self.recording["z"].min()) < _GROUNDED_M
        return bool(self.failure) or came_down or float(self.recording.position_error_m.max()) > _AWAY_M

    @property
    def height_lost_m(self) -> float:
        return float(self.recording["z"][0] - self.recording["z"].min())

    def decided_by(self, fallback: Fallback) -> NDArray[np.bool_]:
        decided: NDArray[np.bool_] = self.recording.fallback == FALLBACK_CODES[fallback]
        return decided

    def stays_below(self, values: Array, bound: float) -> float:
        """Return when `values` (n,) stay below `bound` for good; nan if never."""
        above = np.flatnonzero(values >= bound)
        first = above[-1] + 1 if len(above) else 0
        return float(self.t[first]) if first < len(values) else nan


def fly(common: Common, point: Point) -> Flown:
    """Fly in memory, also a flight that ends early."""
    plan = plan_point(common, point)
    outcome = fly_to_its_end(plan)
    recording = read_recording(plan, outcome.log)
    limits = (plan.vehicle.rotors.idle_speed, _top_speed(plan, outcome.log, recording["t"]))
    return Flown(recording, limits, outcome.failure)


def _top_speed(plan: FlightPlan, log: TopicReader, t: Array) -> Array:
    vehicle = plan.plant_vehicle
    if vehicle.battery is None:
        return np.full_like(t, vehicle.rotors.max_speed)
    time_s, voltage_v = read_series(log, TRUTH, "t", "voltage_v")
    voltage_v[0] = vehicle.battery.full_voltage_v  # not known before the first step
    return vehicle.rotors.max_speed * np.interp(t, time_s, voltage_v) / vehicle.battery.full_voltage_v


COLORS = ("#000000", "#E69F00", "#56B4E9", "#009E73", "#F0E442", "#0072B2", "#D55E00", "#CC79A7")
"""Colours of Okabe and Ito."""
RECOVERY_SHOWN_S = 3.0
LIMITS_SHOWN_S = 6.0

_LEGEND_ROW_IN = 0.24
_SHADE = "#E8E8E8"
_CONTENDERS = {"thesis": "#D55E00", "SE(3)": "#0072B2", "LPV-MPC": "#000000", "LPV-MPC on the path": "#009E73"}
_MOST_M = 50.0  # larger errors are drawn at this one
_ALSO_WITHOUT = ("SE(3)", "LPV-MPC")
_CALLED = {"thesis": "thesis, on its ideal vehicle"}


class StudyResult(NamedTuple):
    row: tuple[str, ...]
    group: str
    flown: Flown


def tracks(results: Sequence[StudyResult]) -> dict[str, Figure]:
    names = _names(result.row[0] for result in results)
    figure, [[axes]] = axes_grid(1, 1, TOP_IN + _LEGEND_ROW_IN, row_in=0.62 * len(names))
    name_rows(figure, [axes], names)
    _compare(axes, [(result, result.row[0]) for result in results])
    put_head(figure, "Position error, track by track", columns=3)
    return {"tracks": figure}


def _names(names: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(names))


def _compare(axes: Axes, named: Sequence[tuple[StudyResult, str]]) -> None:
    names, groups = _names(name for _, name in named), _names(result.group for result, _ in named)
    for group in groups:
        color = _CONTENDERS[group]
        places, rms, max_error, lost = [], [], [], []
        for result, name in named:
            if result.group != group:
                continue
            place = -names.index(name) - 0.17 * (groups.index(group) - 0.5 * (len(groups) - 1))
            if result.flown.lost:
                lost.append(place)
            else:
                places.append(place)
                rms.append(result.flown.rms_m)
                max_error.append(result.flown.max_error_m)
        axes.hlines(places, rms, max_error, color=color, linewidth=1.4)
        axes.plot(rms, places, "o", color=color, markersize=6, label=f"{_CALLED.get(group, group)}: RMS")
        axes.plot(max_error, places, "|", color=color, markersize=10, markeredgewidth=1.8)
        for place in lost:
            axes.text(0.99, place, "lost", transform=axes.get_yaxis_transform(), ha="right", va="center", color=color)
    axes.plot([], [], "k|", markersize=10, markeredgewidth=1.8, label="maximum")
    axes.set_xscale("log")
    axes.set_xlabel(f"position error after {SETTLED_AFTER_S:.0f} s (m)")


def speed(results: Sequence[StudyResult]) -> dict[str, Figure]:
    figure, grid = axes_grid(3, 1, TOP_IN + 2 * _LEGEND_ROW_IN, row_in=2.1)
    quantities: tuple[tuple[str, Callable[[Flown], float]], ...] = (
        ("RMS (m)", lambda flown: min(flown.rms_m, _MOST_M)),
        ("maximum (m)", lambda flown: min(flown.max_error_m, _MOST_M)),
        ("largest tilt (°)", lambda flown: float(flown.tilt_deg[flown.settled].max(initial=0.0))),
    )
    for (axes,), (quantity, of) in zip(grid, quantities, strict=True):
        for group, battery in dict.fromkeys((result.group, result.row[2]) for result in results):
            if battery == "without" and group not in _ALSO_WITHOUT:
                continue
            shown = [result for result in results if (result.group, result.row[2]) == (group, battery)]
            label = group if battery == "with" else f"{group}, no battery"
            for crashed, marker in ((False, "o-" if battery == "with" else "o:"), (True, "x")):
                points = [(float(one.row[1]), of(one.flown)) for one in shown if one.flown.crashed == crashed]
                if points:
                    label = f"{group}, crashed" if crashed else label
                    axes.plot(*zip(*points, strict=True), marker, label=label, color=_CONTENDERS[group], markersize=6)
        _dress(axes, quantity)
    for (axes,) in grid[:2]:
        axes.set_yscale("log")
    grid[2][0].set_ylim(0.0, 190.0)
    grid[-1][0].set_xlabel("top speed of the reference (m/s)")
    put_head(figure, f"Lemniscates of increasing speed, after {SETTLED_AFTER_S:.0f} s", columns=3)
    return {"speed": figure}


def robustness(results: Sequence[StudyResult]) -> dict[str, Figure]:
    on = _names(result.row[0] for result in results)
    plants = _names(result.row[1] for result in results)
    figure, grid = axes_grid(len(on), 1, TOP_IN + _LEGEND_ROW_IN, row_in=0.55 * len(plants))
    name_rows(figure, [axes for (axes,) in grid], [plant.replace(", ", ",\n") for plant in plants])
    for track, (axes,) in zip(on, grid, strict=True):
        named = [(result, result.row[1].replace(", ", ",\n")) for result in results if result.row[0] == track]
        _compare(axes, named)
        axes.set_ylabel(track, fontweight="bold")
    for (axes,) in grid[:-1]:
        axes.set_xlabel("")
    put_head(figure, "Position error with a wrong model of the plant", columns=2)
    return {"robustness": figure}


def recovery(results: Sequence[StudyResult]) -> dict[str, Figure]:
    groups = _names(result.group for result in results)
    by_group = {group: [result for result in results if result.group == group] for group in groups}
    return {
        **{_file_name(f"recovery {group}".strip()): _recoveries(group, shown) for group, shown in by_group.items()},
        **{f"recovery-{result.row[0]}": _recovery(result) for result in by_group[groups[-1]]},
    }


def limits(results: Sequence[StudyResult]) -> dict[str, Figure]:
    return {"-".join(("limits", *map(_file_name, result.row))): _limits(result) for result in results}


def _recoveries(law: str, results: Sequence[StudyResult]) -> Figure:
    figure, grid = axes_grid(3, 1, TOP_IN + _LEGEND_ROW_IN, row_in=1.7)
    quantities: tuple[tuple[str, Callable[[Flown], Array]], ...] = (
        ("height (m)", lambda flown: flown.recording["z"]),
        ("tilt (°)", lambda flown: flown.tilt_deg),
        ("error (m)", lambda flown: flown.recording.position_error_m),
    )
    for (axes,), (quantity, of) in zip(grid, quantities, strict=True):
        for number, result in enumerate(results):
            shown = result.flown.t <= RECOVERY_SHOWN_S
            style = Style((*COLORS[:4], *COLORS[5:])[number % 7], 3.8 - 0.5 * number)
            axes.plot(
                result.flown.t[shown],
                of(result.flown)[shown],
                label=result.row[0].replace("-", ", "),
                **line_style(style),
            )
        _dress(axes, quantity)
    grid[-1][0].set_xlabel("t (s)")
    put_head(figure, f"Recovery at 20 m, from every start, {law}".removesuffix(", "), columns=3)
    return figure


def _recovery(result: StudyResult) -> Figure:
    figure, grid = axes_grid(4, 1, TOP_IN + _LEGEND_ROW_IN)
    flown = result.flown
    shown = flown.t <= RECOVERY_SHOWN_S
    t = flown.t[shown]
    height, tilt, rates, rotors = (axes for (axes,) in grid)
    height.plot(t, flown.recording["z"][shown], **line_style(Style(_FOUR[0], 1.6)))
    tilt.plot(t, flown.tilt_deg[shown], **line_style(Style(_FOUR[0], 1.6)))
    for name, color in zip("pqr", _FOUR, strict=False):
        rates.plot(t, flown.recording[name][shown], label=name, **line_style(Style(color, 1.6)))
    _rotors(rotors, flown, shown)
    quantities = ("height (m)", "tilt (°)", "rates (rad/s)", "Ω (rad/s)")
    for (axes,), quantity in zip(grid, quantities, strict=True):
        for begin_s, end_s in _spans(flown.t[:-1], flown.decided_by(Fallback.RECOVERY)):
            axes.axvspan(begin_s, min(end_s, RECOVERY_SHOWN_S), color=_SHADE, linewidth=0.0, label="recovery law flies")
        _dress(axes, quantity)
    middle_m, half_m = np.mean(height.get_ylim()), max(np.ptp(height.get_ylim()), _MIN_HEIGHTS_M) / 2.0
    height.set_ylim(middle_m - half_m, middle_m + half_m)
    height.ticklabel_format(axis="y", useOffset=False)
    rotors.set_xlabel("t (s)")
    put_head(figure, f"Recovery at 20 m: {result.row[0].replace('-', ', ')} ({result.row[1]})", columns=5)
    return figure


_MIN_HEIGHTS_M = 0.02  # closer ticks would need more digits than there is room for


def _limits(result: StudyResult) -> Figure:
    figure, grid = axes_grid(3, 1, TOP_IN, row_in=1.8)
    flown = result.flown
    begin_s = 0.0 if result.row[0] == "spiral" else SETTLED_AFTER_S
    end_s = begin_s + LIMITS_SHOWN_S
    shown = (flown.t >= begin_s) & (flown.t <= end_s)
    rotors, timeline, error = (axes for (axes,) in grid)
    _rotors(rotors, flown, shown)
    _dress(rotors, "Ω (rad/s)")
    for number, color in enumerate(_KINDS):
        spans = _spans(flown.t[:-1], flown.recording.active[:, number] > 0)
        bars = [(begin, end - begin) for begin, end in spans if end > begin_s and begin < end_s]
        timeline.broken_barh(bars, (-number - 0.35, 0.7), color=color)
    timeline.set_yticks([-number for number in range(len(Active._fields))], Active._fields)
    timeline.set_ylim(-len(Active._fields) + 0.4, 0.6)
    timeline.grid(axis="x", **GRID)
    error.plot(flown.t[shown], flown.recording.position_error_m[shown], **line_style(Style("#000000", 1.2)))
    if begin_s == 0.0:
        error.set_yscale("log")
    _dress(error, "error (m)")
    figure.subplots_adjust(left=0.12)
    error.set_xlim(begin_s, end_s)
    error.set_xlabel("t (s)")
    track, speed_rad_s, battery = result.row
    put_head(figure, f"{track}, rotors up to {speed_rad_s} rad/s, {battery} battery: limits", columns=5)
    return figure


def _rotors(axes: Axes, flown: Flown, shown: Any) -> None:
    minimum, maximum = flown.rotor_limits
    axes.axhline(minimum, label="limits", **line_style(LIMIT))
    axes.plot(flown.t[shown], maximum[shown], **line_style(LIMIT))
    for number, name in enumerate(ROTORS):
        style = Style(_FOUR[number], 1.2)
        axes.plot(flown.t[shown], flown.recording[name][shown], label=f"Ω{number + 1}", **line_style(style))


_KINDS = ("#E69F00", "#56B4E9", "#009E73", "#CC79A7")
"""Colours of active constraints, in their order."""
_FOUR = ("#000000", "#E69F00", "#0072B2", "#009E73")


def _dress(axes: Axes, quantity: str) -> None:
    axes.set_ylabel(quantity)
    axes.grid(**GRID)
    if axes.get_yscale() == "linear":
        axes.yaxis.set_major_locator(round_ticks(5))
    else:
        axes.yaxis.set_minor_formatter(NullFormatter())


def _spans(t: Array, holds: Any) -> list[tuple[float, float]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]])))
    ends = np.append(t, 2.0 * t[-1] - t[-2])
    return [(float(t[begin]), float(ends[end])) for begin, end in edges.reshape(-1, 2)]


def _file_name(text: str) -> str:
    return text.replace(":", "-").replace("=", "-").replace(" ", "-")
