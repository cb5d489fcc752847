"""Tables of `modes.md`, and `modes.png`, from the autopilot's own tables."""

from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from colibri.analysis.tables import markdown
from colibri.autopilot.commander.rules.modes import MODES, ROWS, TRANSITIONS, Event, Mode, Transition, custom_mode
from tools.pages.tables import with_tables

PLACES = {
    Mode.STABILIZED: (0.0, 3.0),
    Mode.ALTITUDE: (0.0, 2.0),
    Mode.POSITION: (0.0, 1.0),
    Mode.OFFBOARD: (0.0, 0.0),
    Mode.HOLD: (2.6, 1.5),
    Mode.TAKEOFF: (2.6, 3.0),
    Mode.ORBIT: (2.6, 0.0),
    Mode.MISSION: (5.2, 3.0),
    Mode.TRACK: (5.2, 2.0),
    Mode.FOLLOW: (5.2, 0.0),
    Mode.RETURN: (8.4, 3.0),
    Mode.LAND: (8.4, 1.0),
}
_DISARMED = (11.9, 1.5)
_ANY = (5.2, 1.0)


def tables() -> list[str]:
    modes = [
        (
            row.mode,
            f"{row.main}/{row.sub} = {custom_mode(row.mode)}",
            str(row.standard or "-"),
            row.meaning,
            "; ".join(need.name.lower().replace("_", " ") for need in row.needs) or "-",
            "yes" if row.to_arm else "no",
        )
        for row in MODES
    ]
    headings = ("mode", "custom mode", "standard mode", "effect", "needs", "arms")
    transitions = [(", ".join(row.sources) or "any mode", *_outcome(row)) for row in TRANSITIONS]
    return [markdown(headings, modes, names=6), markdown(("in", "when", "then", "rotors"), transitions, names=4)]


def _outcome(row: Transition) -> tuple[str, str, str]:
    if row.event is Event.ARM:
        return f"{row.event}, every check passes", "the same mode", "turn"
    target = row.target or ("the mode selected" if row.event is Event.SELECT else "the same mode")
    return row.event, target, "stop" if row.disarms else "-"


def draw(path: Path) -> None:
    figure = Figure(figsize=(13.0, 5.2))
    axes = figure.subplots()
    axes.set_xlim(-1.2, 13.0)
    axes.set_ylim(-1.1, 3.9)
    axes.axis("off")
    axes.add_patch(
        FancyBboxPatch((-0.9, -0.6), 10.1, 4.1, boxstyle="round,pad=0.15", facecolor="#f4f7fa", edgecolor="#8899aa")
    )
    axes.text(-0.9, -0.95, "armed: select any mode whose needs are met", fontsize=10, color="#445566")
    style = {"boxstyle": "round,pad=0.35", "facecolor": "white", "edgecolor": "#223344"}
    for mode, place in PLACES.items():
        needs = ROWS[mode].needs
        axes.text(*place, mode + ("*" if needs else ""), ha="center", va="center", fontsize=11, bbox=style, zorder=3)
    axes.text(*_DISARMED, "disarmed", ha="center", va="center", fontsize=11, bbox=style, zorder=3)
    dashed = {**style, "linestyle": "--", "facecolor": "#f4f7fa"}
    axes.text(*_ANY, "any mode", ha="center", va="center", fontsize=11, bbox=dashed, zorder=3)
    axes.text(9.2, -0.95, "* has needs, see the table", fontsize=10, color="#445566", ha="right")
    arrow = {"arrowstyle": "-|>", "color": "#225588", "shrinkA": 22, "shrinkB": 24, "linewidth": 1.2}
    for row in TRANSITIONS:
        for x0, y0 in [PLACES[mode] for mode in row.sources] or [_ANY]:
            if row.target is None or row.disarms:
                continue
            x1, y1 = PLACES[row.target]
            axes.annotate("", xy=(x1, y1), xytext=(x0, y0), arrowprops=arrow, zorder=1)
            axes.text(
                0.55 * x0 + 0.45 * x1,
                0.55 * y0 + 0.45 * y1,
                row.event,
                fontsize=8.5,
                color="#225588",
                ha="center",
                bbox={"facecolor": "#f4f7fa", "edgecolor": "none", "pad": 0.8},
                zorder=2,
            )
    rises = [row.event for row in TRANSITIONS if row.disarms]
    axes.annotate(
        "", xy=(_DISARMED[0] - 0.65, 1.75), xytext=(8.65, 1.75), arrowprops={**arrow, "shrinkA": 0, "shrinkB": 0}
    )
    axes.text(10.3, 1.85, "\n".join(dict.fromkeys(rises)), fontsize=8.5, color="#225588", ha="center", va="bottom")
    axes.annotate(
        "", xy=(8.65, 1.25), xytext=(_DISARMED[0] - 0.65, 1.25), arrowprops={**arrow, "shrinkA": 0, "shrinkB": 0}
    )
    axes.text(10.3, 1.15, "armed, in the\nsame mode", fontsize=8.5, color="#225588", ha="center", va="top")
    figure.savefig(path, dpi=110, bbox_inches="tight")


def write(folder: Path) -> None:
    draw(folder / "modes.png")


PAGES = {"modes.md": lambda page: with_tables(page, tables())}
