"""The figure of a failed flight."""

from collections.abc import Sequence
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from colibri.common.process.writable_folders import use_writable_folders
from colibri.sitl.flight_record import Columns, mode_name, tilt_deg

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MAX_TEXTS = 18
"""Lines that fit below the view from above; the last ones are shown."""
_ROOM_FOR_LEGEND = 0.15
_END_COLOUR = "tab:red"


def draw(
    flown: Columns, texts: Sequence[tuple[float, str]], path: Path, *, failed_s: float, title: str, reason: str
) -> None:
    """Draw a flight that failed at `failed_s`; `texts` have times in s."""
    use_writable_folders()
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14.0, 8.5), layout="constrained")
    figure.suptitle("\n".join(filter(None, (_line(title, 130), _line(reason, 130)))), fontsize=11)
    axes = figure.subplot_mosaic(
        [["place", "plan"], ["tilt", "texts"], ["mode", "texts"]], height_ratios=(4, 2, 2), width_ratios=(3, 2)
    )
    for name in ("place", "tilt"):
        axes[name].sharex(axes["mode"])
        axes[name].tick_params(labelbottom=False)
    _draw_place(axes["place"], flown, failed_s)
    axes["tilt"].plot(flown["t"], tilt_deg(flown))
    axes["tilt"].set_ylabel("tilt, degrees")
    _draw_modes(axes["mode"], flown)
    _draw_plan(axes["plan"], flown)
    numbered = list(enumerate(texts, 1))[-_MAX_TEXTS:]
    for name in ("place", "tilt", "mode"):
        for _, (time_s, _text) in numbered:
            axes[name].axvline(time_s, color="0.7", linewidth=0.8, linestyle=":")
        axes[name].axvline(failed_s, color=_END_COLOUR)
    _write_texts(axes["texts"], axes["place"], numbered)
    figure.savefig(path, dpi=100)


def _draw_place(axes: "Axes", flown: Columns, failed_s: float) -> None:
    for name, label, width_pt in (("x", "east", 4.0), ("y", "north", 2.4), ("z", "up", 1.2)):
        axes.plot(flown["t"], flown[name], label=label, linewidth=width_pt)
    axes.set_ylabel("position, m")
    bottom, top = axes.get_ylim()
    axes.set_ylim(bottom, top + _ROOM_FOR_LEGEND * (top - bottom))
    axes.legend(loc="upper left", ncols=3)
    axes.text(
        *(failed_s, 1.06, f"failed at {failed_s:.3f} s"),
        transform=axes.get_xaxis_transform(),
        ha="right",
        va="bottom",
        color=_END_COLOUR,
    )


def _draw_modes(axes: "Axes", flown: Columns) -> None:
    numbers, which = np.unique(flown["custom_mode"], return_inverse=True)
    axes.step(flown["t"], which, where="post")
    armed = flown["armed"] > 0.0
    axes.fill_between(flown["t"], -0.5, len(numbers) - 0.5, where=armed, alpha=0.15, label="armed")
    axes.set_yticks(range(len(numbers)), [mode_name(number) for number in numbers])
    axes.legend(loc="upper left")
    axes.set_xlabel("simulated time, s")


def _draw_plan(axes: "Axes", flown: Columns) -> None:
    east, north = flown["x"], flown["y"]
    axes.plot(east, north)
    axes.plot(east[0], north[0], "o", color="tab:green", label="begin")
    axes.plot(east[-1], north[-1], "X", markersize=9, label="failed", color=_END_COLOUR)
    half_m = 0.55 * max(float(np.ptp(east)), float(np.ptp(north)), 2.0)
    for set_limits, along in ((axes.set_xlim, east), (axes.set_ylim, north)):
        middle = 0.5 * (float(along.min()) + float(along.max()))
        set_limits(middle - half_m, middle + half_m)
    axes.set_aspect("equal")
    axes.set_xlabel("east, m")
    axes.set_ylabel("north, m")
    axes.legend(loc="upper left")
    axes.set_title("from above", fontsize=10)


def _write_texts(axes: "Axes", timeline: "Axes", numbered: Sequence[tuple[int, tuple[float, str]]]) -> None:
    axes.axis("off")
    lines = [f"{number:>3}  {time_s:8.3f} s  {_line(text, 54)}" for number, (time_s, text) in numbered]
    axes.text(0.0, 1.0, "\n".join(lines or ["no texts"]), va="top", family="monospace", fontsize=8.5)
    shown_s, room_s = -inf, 0.02 * float(np.diff(timeline.get_xlim())[0])
    for number, (time_s, _) in numbered:
        if time_s > shown_s + room_s:  # of several at a time, the first number
            shown_s = time_s
            over = timeline.get_xaxis_transform()
            timeline.text(time_s, 1.01, str(number), transform=over, ha="center", va="bottom", fontsize=8)


def _line(text: str, width: int) -> str:
    line = " ".join(text.split())
    return (line if len(line) <= width else f"{line[: width - 1]}…").replace("$", r"\$")
