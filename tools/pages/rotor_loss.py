"""Table and figure of `rotor-loss.md`: flights that lose a rotor."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from colibri.analysis.figures import GRID, put_head, write_figure
from colibri.analysis.tables import markdown
from colibri.common.types import Array
from colibri.mavlink.hil.feedback import Feedback
from tools.pages.rotor_loss_flights import COLUMNS, HEIGHT_M, UPRIGHT_DEG, RotorLossCase, RotorLossFlight, fly_all
from tools.pages.tables import with_tables

SEEDS = range(50)
CASES = (
    RotorLossCase("state feedback, calm; the blades fly off", Feedback.STATE),
    RotorLossCase("sensors, calm; the blades fly off", Feedback.SENSORS),
    RotorLossCase("sensors, calm; the motor runs down", Feedback.SENSORS, runs_down=True),
    RotorLossCase(
        "sensors, 3 m/s and light turbulence; the blades fly off", Feedback.SENSORS, wind_m_s=3.0, turbulence="light"
    ),
    RotorLossCase(
        "sensors, 5 m/s and moderate turbulence; the same", Feedback.SENSORS, wind_m_s=5.0, turbulence="moderate"
    ),
)
_DRAWN = CASES[3]
_THICK_SEED = 5
_MEASURES: tuple[tuple[str, Callable[[RotorLossFlight], float], str], ...] = (
    ("detected after (ms)", lambda flown: 1e3 * flown.noticed_s, ".0f"),
    ("largest tilt (°)", lambda flown: flown.peak_deg, ".1f"),
    ("below 20° for good after (s)", lambda flown: flown.upright_s, ".2f"),
    ("tilt from 1 s on (°)", lambda flown: flown.settled_deg, ".1f"),
    ("farthest (m)", lambda flown: flown.max_distance_m, ".2f"),
    ("landed at (m)", lambda flown: flown.landed_m, ".2f"),
    ("touch-down (m/s)", lambda flown: flown.touched_m_s, ".2f"),
    ("spin (rad/s)", lambda flown: flown.spin_rad_s, ".1f"),
)
_MANY, _ONE, _LIMIT = "#9DB8D2", "#0B3C6F", "#D55E00"
_ROTORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")
_FIRST_S, _WHOLE_S = (-0.1, 2.0), (-0.5, 16.0)


def table(flown: Mapping[RotorLossCase, Sequence[RotorLossFlight]]) -> str:
    headings = ("50 flights each", "successful", *(name for name, _, _ in _MEASURES))
    rows = [(case.name, f"{sum(one.well for one in of)} of {len(of)}", *_cells(of)) for case, of in flown.items()]
    return markdown(headings, rows, names=1)


def draw(flown: Sequence[RotorLossFlight], title: str) -> Figure:
    figure = Figure(figsize=(10.0, 9.6), dpi=130)
    grid = figure.add_gridspec(5, 2, top=0.9, bottom=0.055, left=0.08, right=0.985, hspace=0.14, wspace=0.13)
    quantities: tuple[tuple[str, Callable[[Array], Array]], ...] = (
        ("height (m)", lambda path: path[:, COLUMNS.index("z")]),
        ("off its place (m)", lambda path: np.hypot(path[:, 1], path[:, 2])),
        ("tilt of the thrust (°)", lambda path: path[:, COLUMNS.index("tilt")]),
        ("spin (rad/s)", lambda path: np.abs(path[:, COLUMNS.index("spin")])),
    )
    for column, shown in enumerate((_FIRST_S, _WHOLE_S)):
        for row, (name, quantity) in enumerate(quantities):
            axes = figure.add_subplot(grid[row, column])
            for one in sorted(flown, key=lambda one: one.seed == _THICK_SEED):
                is_one = one.seed == _THICK_SEED
                style: dict[str, Any] = (
                    {"color": _ONE, "linewidth": 1.4} if is_one else {"color": _MANY, "linewidth": 0.4}
                )
                label = f"seed {one.seed}" if is_one else "the other seeds"
                axes.plot(one.path[:, 0], quantity(one.path), label=label, **style)
            _finish(axes, name if column == 0 else "", shown)
            if name.startswith("tilt"):
                axes.axhline(UPRIGHT_DEG, color=_LIMIT, linewidth=0.9, linestyle="--", label="20°")
        axes = figure.add_subplot(grid[len(quantities), column])
        _draw_rotors(axes, next(one for one in flown if one.seed == _THICK_SEED))
        _finish(axes, "rotor commands" if column == 0 else "", shown, last=True)
    put_head(figure, title)
    return figure


def _draw_rotors(axes: Axes, flown: RotorLossFlight) -> None:
    for rotor, color in enumerate(_ROTORS):
        label = f"rotor {rotor + 1}"
        axes.plot(flown.path[:, 0], flown.path[:, COLUMNS.index("c1") + rotor], color=color, linewidth=0.7, label=label)


def _finish(axes: Axes, name: str, shown: tuple[float, float], *, last: bool = False) -> None:
    axes.set_xlim(*shown)
    axes.set_ylabel(name)
    axes.grid(**GRID)
    axes.tick_params(labelbottom=last)
    if last:
        axes.set_xlabel("since the loss (s)")


def _cells(flown: Sequence[RotorLossFlight]) -> list[str]:
    cells = []
    for _, measure, form in _MEASURES:
        values = [measure(one) for one in flown]
        cells.append(f"{float(np.median(values)):{form}}; {max(values):{form}}")
    return cells


def write(folder: Path) -> bool:
    """Return whether every flight was well, except in the last case."""
    flown = fly_all(CASES, SEEDS)
    path = folder / "rotor-loss.md"
    path.write_text(with_tables(path.read_text(encoding="utf-8"), [table(flown)]), encoding="utf-8")
    title = f"A rotor lost at {HEIGHT_M:.0f} m, {len(SEEDS)} seeds: {_DRAWN.name}"
    write_figure(draw(flown[_DRAWN], title), folder / "rotor-loss")
    return all(one.well for case in CASES[:-1] for one in flown[case])
