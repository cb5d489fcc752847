"""Tables of `failsafes.md`, and `failsafes.png`, from the autopilot's table."""

from pathlib import Path
from textwrap import wrap

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from colibri.analysis.tables import markdown
from colibri.autopilot.commander.rules.failsafe_table import MEANINGS, NAMES, TABLE, Action, FailsafeRow
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.parameters.definitions import definitions
from colibri.mavlink.parameters.store import Parameter, ParamType
from colibri.plant.vehicle.description import load_vehicle
from tools.pages.tables import with_tables

_LADDER = (Action.HOLD, Action.RETURN, Action.LAND, Action.DESCEND, Action.TERMINATE)
_STEP, _LINE, _WIDTH = 1.45, 0.19, 84
_STATE = {"boxstyle": "round,pad=0.45", "facecolor": "white", "edgecolor": "#223344"}


def tables() -> list[str]:
    profile = load_profile("flight")
    known = {each.name: each for each in definitions(profile, load_vehicle(profile.simulation.vehicle))}
    ranks = [(str(int(action)), NAMES[action], MEANINGS[action]) for action in sorted(Action, reverse=True)]
    conditions = [
        (
            row.condition,
            row.holds,
            "<br>".join(_shown(known[name]) for name in row.limits) or "-",
            _shown(known[row.delay]) if row.delay else "-",
            f"`{row.parameter}`: {_choices(row)}",
            row.clears,
        )
        for row in TABLE
    ]
    headings = ("condition", "holds when", "limits", "delay", "action", "over when")
    return [markdown(("rank", "action", "effect"), ranks, names=3), markdown(headings, conditions, names=6)]


def _shown(parameter: Parameter) -> str:
    whole = parameter.kind == ParamType.INT
    value = str(int(parameter.default)) if whole else f"{parameter.default:.6g}"
    unit = "" if parameter.unit in ("", "norm") else f" {parameter.unit}"
    return f"`{parameter.name}` {value}{unit}"


def _choices(row: FailsafeRow) -> str:
    shown = (f"{number} {NAMES[action]}" for number, action in row.choices)
    return ", ".join(
        f"**{text}**" if number == row.default else text for text, (number, _) in zip(shown, row.choices, strict=True)
    )


def draw(path: Path) -> None:
    figure = Figure(figsize=(13.0, 7.6))
    axes = figure.subplots()
    axes.set_xlim(0.0, 13.0)
    axes.set_ylim(-0.9, 7.4)
    axes.axis("off")
    top = _STEP * (len(_LADDER) - 1)
    for x, name in ((0.1, "the\npilot's\nmode"), (11.9, "disarmed")):
        axes.add_patch(FancyBboxPatch((x, -0.3), 1.0, top + 0.6, boxstyle="round,pad=0.05", facecolor="white"))
        axes.text(x + 0.5, 0.5 * top, name, ha="center", va="center", fontsize=11)
    for rung, action in enumerate(_LADDER):
        y = _STEP * rung
        axes.text(8.6, y, NAMES[action], ha="center", va="center", fontsize=11, bbox=_STATE, zorder=3)
        _arrow(axes, (1.15, y), (7.8, y))
        _label(axes, 4.4, y + 0.08, *_leading_to(action))
        if action is not Action.HOLD:
            _arrow(axes, (9.4, y), (11.85, y), "#8899aa")
            _arrow(axes, (8.6, y - _STEP + 0.3), (8.6, y - 0.3), "#aa3322")
    axes.text(8.7, 0.5 * _STEP, "a higher rank alone", fontsize=9, color="#aa3322", va="center")
    axes.text(10.6, top + 0.08, "at once", fontsize=9, color="#556677", ha="center", va="bottom")
    axes.text(10.6, _STEP + 0.08, "landed", fontsize=9, color="#556677", ha="center", va="bottom")
    _arrow(axes, (7.8, -0.2), (1.15, -0.2), "#338855")
    axes.text(
        4.4, -0.28, "the pilot chooses a mode, from any of them", fontsize=9, color="#338855", ha="center", va="top"
    )
    note = "bold: by default    plain: by other parameter values    warnings are only in the table"
    axes.text(0.1, top + 1.0, note, fontsize=9, color="#445566", va="bottom")
    figure.savefig(path, dpi=110, bbox_inches="tight")


def _leading_to(action: Action) -> tuple[str, str]:
    """Return the default and the possible conditions of an action."""
    default = [str(row.condition) for row in TABLE if dict(row.choices)[row.default] is action]
    able = [
        str(row.condition)
        for row in TABLE
        if str(row.condition) not in default and action in dict(row.choices).values()
    ]
    return ", ".join(default), ", ".join(able)


def _arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float], color: str = "#225588") -> None:
    axes.annotate(
        "", xy=end, xytext=start, arrowprops={"arrowstyle": "-|>", "color": color, "linewidth": 1.2}, zorder=1
    )


def _label(axes: Axes, x: float, y: float, default: str, able: str) -> None:
    heavy, light = (wrap(text, _WIDTH) for text in (default, able))
    for up, line in enumerate(reversed(heavy + light)):
        weight = "bold" if up >= len(light) else "normal"
        axes.text(x, y + _LINE * up, line, fontsize=8, weight=weight, color="#225588", ha="center", va="bottom")


def write(folder: Path) -> None:
    draw(folder / "failsafes.png")


PAGES = {"failsafes.md": lambda page: with_tables(page, tables())}
