"""`weather.png` and `.svg`: the air at each strength of turbulence."""

from math import pi
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.signal import welch

from colibri.analysis.figures import GRID, put_head, write_figure
from colibri.common.types import Array
from colibri.plant.environment.turbulence import CALM, W20_KNOTS, Air, scales
from colibri.plant.environment.weather import INTENSITIES, Gust, Intensity, Weather, Wind

_WIND = Wind(8.0, 270.0)
_GUST = Gust(Wind(6.0, 270.0), 25.0, 5.0)
_HEIGHT_M = 3.048
_FRAME_US = 4000
_SHOWN_S = 40.0
_MEASURED_S = 1000.0
_RESOLVED_HZ = 0.05  # below, windows of 65 s blur what they measure
_COLORS = {"light": "#E69F00", "moderate": "#0072B2", "severe": "#D55E00"}


def blow(weather: Weather, duration_s: float) -> tuple[Array, Array]:
    """Return times, s, (n,), and velocities of the air at 10 feet, ENU, m/s, (n, 3)."""
    air = Air(weather)
    velocity, eddies = air.begin(_HEIGHT_M)
    velocities = [velocity]
    for frame in range(1, round(duration_s * 1e6 / _FRAME_US)):
        velocity, eddies = air.go_on(eddies, frame * _FRAME_US, _HEIGHT_M, CALM, _FRAME_US)
        velocities.append(velocity)
    times: Array = np.array([1e-6 * _FRAME_US * frame for frame in range(len(velocities))])
    return times, np.array(velocities)


def draw() -> Figure:
    figure = Figure(figsize=(8.6, 7.6), dpi=150)
    times = figure.add_gridspec(2, 1, top=0.89, bottom=0.5, left=0.09, right=0.97, hspace=0.12)
    spectra = figure.add_gridspec(1, 2, top=0.42, bottom=0.07, left=0.09, right=0.97, wspace=0.22)
    over_time = [figure.add_subplot(times[row, 0]) for row in (0, 1)]
    for intensity in reversed(INTENSITIES):
        t, velocity = blow(Weather(_WIND, (_GUST,), intensity, seed=1), _SHOWN_S)
        for axes, axis in zip(over_time, (0, 2), strict=True):
            axes.plot(t, velocity[:, axis], color=_COLORS[intensity], linewidth=0.9, label=intensity)
    t, velocity = blow(Weather(_WIND, (_GUST,)), _SHOWN_S)
    over_time[0].plot(t, velocity[:, 0], "k", linewidth=1.4, label="mean wind and gust")
    for axes, quantity in zip(over_time, ("east (m/s)", "up (m/s)"), strict=True):
        axes.set_ylabel(quantity)
        axes.set_xlim(0.0, _SHOWN_S)
        axes.grid(**GRID)
    over_time[0].tick_params(labelbottom=False)
    over_time[1].set_xlabel("t (s)")
    for column, (axis, name) in enumerate(((0, "along the wind"), (2, "upwards"))):
        _spectra(figure.add_subplot(spectra[0, column]), axis, name)
    put_head(figure, "Wind of 8 m/s from the west, a gust of 6 m/s, and turbulence, at 10 feet")
    return figure


def _spectra(axes: Axes, axis: int, name: str) -> None:
    for intensity in INTENSITIES:
        _, velocity = blow(Weather(_WIND, turbulence=intensity, seed=1), _MEASURED_S)
        frequencies, measured = welch(velocity[:, axis], fs=1e6 / _FRAME_US, nperseg=1 << 14)
        shown = (frequencies > _RESOLVED_HZ) & (frequencies < 30.0)
        hz = frequencies[shown]
        axes.loglog(hz, measured[shown], color=_COLORS[intensity], linewidth=0.9)
        axes.loglog(hz, _dryden(intensity, axis, hz), "k--", linewidth=1.2, label="MIL-F-8785C")
    axes.set_xlabel("frequency (Hz)")
    axes.set_ylabel(f"{name} (m²/s²/Hz)")
    axes.grid(**GRID)


def _dryden(intensity: Intensity, axis: int, hz: Array) -> Array:
    scale = scales(W20_KNOTS[intensity], _HEIGHT_M)
    sigma, length_m = (scale.sigma_w_m_s, scale.length_w_m) if axis == 2 else (scale.sigma_uv_m_s, scale.length_uv_m)
    squared = (2.0 * pi * hz * length_m / _WIND.speed_m_s) ** 2
    shape = (1.0 + 3.0 * squared) / (1.0 + squared) ** 2 if axis == 2 else 2.0 / (1.0 + squared)
    return 2.0 * sigma**2 * length_m / _WIND.speed_m_s * shape


def write(folder: Path) -> None:
    write_figure(draw(), folder / "weather")
