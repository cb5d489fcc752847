"""`flight-payload.png`: a payload picked up and dropped."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from colibri.analysis.figures import GRID, put_head, write_figure
from colibri.common.types import Array
from colibri.sitl.backends.setting import Setting
from colibri.sitl.session import Flights

PAYLOAD_KG = 0.15
PICKED_UP_S, DROPPED_S, END_S = 20.0, 35.0, 50.0
HEIGHT_M = 5.0
_SHOWN_FROM_S = 18.0
_TRACKS = {"hover": None, "lemniscate": f"lemniscate:height={HEIGHT_M:g}"}
_COLOURS = {"mass learned": "#0072B2", "mass not learned": "#D55E00"}


class Laden(NamedTuple):
    t: Array  # s, (n,)
    height_error_m: Array  # (n,)
    told: Array  # times, s, and reported masses, kg, (m, 2)


def fly(track: str | None, *, learns: bool, seconds: tuple[float, float, float]) -> Laden:
    """Fly a track or hover; `seconds` are pick-up, drop and end."""
    picked_up_s, dropped_s, end_s = seconds
    params = {} if learns else {"LPV_MASS_RATE": 0.0}
    with Flights(Setting(airborne=HEIGHT_M, track=track, params=params), None) as flights:
        sitl = flights.begin()
        sitl.run(picked_up_s)
        sitl.payload_kg = PAYLOAD_KG
        sitl.run(dropped_s - picked_up_s)
        sitl.payload_kg = 0.0
        sitl.run(end_s - dropped_s)
        flown = sitl.flown()
        told = [m for m in sitl.gcs.heard["NAMED_VALUE_FLOAT"] if m.name == "mass_kg"]
    return Laden(flown["t"], flown["z"] - HEIGHT_M, np.array([(1e-3 * m.time_boot_ms, m.value) for m in told]))


def draw(flights: dict[str, dict[str, Laden]]) -> Figure:
    figure = Figure(figsize=(8.6, 7.2), dpi=150)
    figure.subplots_adjust(top=0.88, bottom=0.08, left=0.1, right=0.97, hspace=0.14)
    *heights, masses = figure.subplots(len(flights) + 1, 1, sharex=True)
    for axes, (track, flown) in zip(heights, flights.items(), strict=True):
        for label, laden in flown.items():
            shown = laden.t >= _SHOWN_FROM_S  # what came before would set the scale
            t, error_mm = laden.t[shown], 1e3 * laden.height_error_m[shown]
            axes.plot(t, error_mm, color=_COLOURS[label], linewidth=1.2, label=label)
        _dress(axes, f"{track} (mm)")
    title = f"Height error, {1e3 * PAYLOAD_KG:.0f} g picked up at {PICKED_UP_S:g} s and dropped at {DROPPED_S:g} s"
    put_head(figure, title)
    for track, dashes in zip(flights, ("-", "--"), strict=True):
        told = flights[track]["mass learned"].told
        masses.plot(told[:, 0], told[:, 1], dashes, color=_COLOURS["mass learned"], label=track)
    masses.set_xlim(_SHOWN_FROM_S, END_S)
    masses.set_xlabel("t (s)")
    _dress(masses, "mass learned (kg)")
    masses.legend(loc="upper right", frameon=False)
    return figure


def _dress(axes: Axes, quantity: str) -> None:
    for instant_s in (PICKED_UP_S, DROPPED_S):
        axes.axvline(instant_s, color="0.6", linewidth=0.8, linestyle=":")
    axes.set_ylabel(quantity)
    axes.grid(**GRID)


def write(folder: Path) -> None:
    seconds = (PICKED_UP_S, DROPPED_S, END_S)
    flights = {
        name: {label: fly(track, learns=label == "mass learned", seconds=seconds) for label in _COLOURS}
        for name, track in _TRACKS.items()
    }
    write_figure(draw(flights), folder / "flight-payload", ("png",))
