"""`lemniscate.gif`: a lap of the lemniscate as it was flown."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.figure import Figure

from colibri.common.rotations import quaternion_from_euler, rotation_matrix
from colibri.common.types import Array
from colibri.experiments import fly
from colibri.experiments.flight import SampleTable
from colibri.plant.vehicle.description import load_vehicle

LAP_S = 6.0
FROM_S = 24.0  # by then nothing is left of the start
FRAMES_A_SECOND = 10
_TRAIL_S = 1.6
_ARM_M = 0.45  # longer than the vehicle's own, so that it is seen
_THRUST_M_N = 0.16
_GROUND, _AIR, _TRACK, _BODY, _THRUST = "#7d8a99", "#D55E00", "#b6c2cf", "#223344", "#0072B2"


def draw(path: Path, *, frames_a_second: int = FRAMES_A_SECOND, width_in: float = 6.4) -> None:
    flight = fly("lemniscate", duration=FROM_S + LAP_S)
    table = flight.samples
    figure = Figure(figsize=(width_in, 0.56 * width_in), dpi=100)
    axes: Any = figure.add_axes((0.0, -0.02, 1.0, 1.0), projection="3d")
    _set_the_scene(axes, table)
    shown = [axes.plot([], [], [], color, lw=width, solid_capstyle=end)[0] for color, width, end in _LINES]
    clock = figure.text(0.03, 0.94, "", family="monospace", fontsize=9, color=_BODY)
    times = np.arange(0.0, LAP_S, 1.0 / frames_a_second) + FROM_S

    def show(time_s: float) -> list[Any]:
        rows = [int(np.searchsorted(table["t"], at)) for at in (time_s - _TRAIL_S, time_s)]
        lines = _lines_at(table, *rows)
        for artist, line in zip(shown, lines, strict=True):
            artist.set_data_3d(*line.T)
        row = table[rows[1]]
        speed = np.sqrt(row["u"] ** 2 + row["v"] ** 2 + row["w"] ** 2)
        tilt = np.degrees(np.arccos(np.cos(row["phi"]) * np.cos(row["theta"])))
        off_mm = 1e3 * np.sqrt(sum((row[axis] - row[f"{axis}_ref"]) ** 2 for axis in "xyz"))
        clock.set_text(f"{speed:4.1f} m/s   tilt {tilt:3.0f}°   off its reference {off_mm:5.2f} mm")
        return [*shown, clock]

    animation = FuncAnimation(figure, show, frames=times, blit=False)
    animation.save(path, writer=PillowWriter(fps=frames_a_second))


_ARM = (_BODY, 2.6, "round")
_LINES = ((_GROUND, 1.2, None), (_AIR, 2.2, None), (_THRUST, 2.0, None), _ARM, _ARM)


def _set_the_scene(axes: Any, table: SampleTable) -> None:
    lap = table[table["t"] >= FROM_S]
    axes.plot(lap["x_ref"], lap["y_ref"], lap["z_ref"], color=_TRACK, lw=1.0)
    axes.plot(lap["x_ref"], lap["y_ref"], np.zeros(len(lap)), color="#e3e8ee", lw=1.0)
    axes.set(xlim=(-4.2, 4.2), ylim=(-2.6, 2.6), zlim=(0.0, 4.0))
    axes.set(xticks=(-4, -2, 0, 2, 4), yticks=(-2, 0, 2), zticks=(0, 2, 4))
    axes.set_box_aspect((8.4, 5.2, 3.6), zoom=1.24)
    axes.view_init(elev=24, azim=-62)
    axes.tick_params(labelsize=7, colors=_GROUND, pad=-2)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))


def _lines_at(table: SampleTable, first: int, last: int) -> list[Array]:
    """Return shadow, trail, thrust and both arms, ENU, (n, 3), m."""
    trail = np.column_stack([table[axis][first : last + 1] for axis in "xyz"])
    row = table[last]
    turn = np.array(rotation_matrix(quaternion_from_euler(row["phi"], row["theta"], row["psi"])))
    here = trail[-1]
    thrust = np.array([here, here + turn @ [0.0, 0.0, _THRUST_M_N * row["U1"]]])
    arms_m = load_vehicle("hummingbird").arms_m()
    tips = [here + turn @ (arm / np.linalg.norm(arm) * _ARM_M) for arm in arms_m]
    return [trail * [1.0, 1.0, 0.0], trail, thrust, np.array([tips[0], tips[2]]), np.array([tips[1], tips[3]])]


def write(folder: Path) -> None:
    draw(folder / "lemniscate.gif")
