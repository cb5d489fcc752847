"""`house.png`: packages and their layers, from the import contracts."""

import re
import tomllib
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

ROOT = Path(__file__).parents[3]
PACKAGES = {
    "colibri": ("#f3e9f7", "what a user imports or runs"),
    "colibri.autopilot": ("#e6f0fa", "frames in, commands out"),
    "colibri.plant": ("#e9f6ec", "the vehicle and its world"),
    "colibri.mavlink": ("#fdf3e1", "knows no plant, no autopilot"),
    "colibri.common": ("#eef1f4", "knows no vehicle"),
}
_INK, _FRAME = "#223344", "#8899aa"
_WIDTH, _ROW, _GAP, _SPACE = 3.0, 0.36, 0.5, 0.3
_COLUMNS = (("colibri",), ("colibri.autopilot",), ("colibri.plant", "colibri.common"), ("colibri.mavlink",))
_FILES = {"__main__", "pytest_plugin", "errors"}
_ALONE = ("autopilot", "plant", "mavlink", "common")


def layers() -> dict[str, list[list[str]]]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    found: dict[str, list[list[str]]] = {}
    for contract in project["tool"]["importlinter"]["contracts"]:
        for package in set(contract.get("containers", ())) & PACKAGES.keys():
            rows = [re.split(r" [|:] ", layer) for layer in contract["layers"]]
            leave = _FILES | set(_ALONE if package == "colibri" else ())
            found[package] = [
                kept for row in rows if (kept := [room for room in row if _is_room(package, room, leave)])
            ]
    return found


def _is_room(package: str, room: str, leave: set[str]) -> bool:
    folder = ROOT / package.removeprefix("colibri.").replace(".", "/") / room
    return room not in leave and folder.is_dir()


def description() -> str:
    """Return the drawing as text: metadata that shows whether the picture is current."""
    return "; ".join(f"{package}: {' > '.join(' '.join(row) for row in rows)}" for package, rows in layers().items())


def draw(path: Path) -> None:
    figure = Figure(figsize=(12.0, 6.4), dpi=100)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.axis("off")
    rooms = layers()
    bottom = -max(sum(_height(rooms[package]) + _SPACE for package in packages) for packages in _COLUMNS) + _SPACE
    for column, packages in enumerate(_COLUMNS):
        top = 0.0
        for package in packages:
            top = _package(axes, column * (_WIDTH + _GAP), top, package, rooms[package]) - _SPACE
    style: dict[str, Any] = {"arrowstyle": "-|>", "color": _INK, "linewidth": 1.4}
    for column in range(len(_COLUMNS) - 1):
        left = column * (_WIDTH + _GAP) + _WIDTH
        axes.annotate("", xy=(left + _GAP, -0.35), xytext=(left, -0.35), arrowprops=style)
    common = _height(rooms["colibri.plant"]) + _SPACE + 0.35
    axes.annotate("", xy=(left, -common), xytext=(left + _GAP, -common), arrowprops=style)
    axes.set_xlim(-0.2, len(_COLUMNS) * (_WIDTH + _GAP) - 0.3)
    axes.set_ylim(bottom - 0.55, 0.25)
    note = "imports follow the arrows, and within a package go down; of the plant, autopilot/ reads vehicle/ alone"
    axes.text(0.0, bottom - 0.3, note, fontsize=9.5, color=_INK, va="center")
    figure.savefig(path, metadata={"Description": description()})


def _height(rows: list[list[str]]) -> float:
    return 0.95 + sum(_ROW * len(row) + 0.14 for row in rows)


def _package(axes: Axes, left: float, top: float, package: str, rows: list[list[str]]) -> float:
    colour, what = PACKAGES[package]
    height = _height(rows)
    frame: dict[str, Any] = {"boxstyle": "round,pad=0,rounding_size=0.12", "edgecolor": _FRAME}
    axes.add_patch(FancyBboxPatch((left, top - height), _WIDTH, height, facecolor=colour, **frame))
    axes.text(left + 0.15, top - 0.3, package.removeprefix("colibri.") + "/", fontsize=12.5, weight="bold", color=_INK)
    axes.text(left + 0.15, top - 0.6, what, fontsize=9.0, color=_INK)
    at = top - 0.78
    for row in rows:
        tall = _ROW * len(row)
        axes.add_patch(FancyBboxPatch((left + 0.12, at - tall), _WIDTH - 0.24, tall, facecolor="white", **frame))
        for room in row:
            axes.text(left + 0.26, at - _ROW / 2.0, room, fontsize=10.0, color=_INK, va="center", family="monospace")
            at -= _ROW
        at -= 0.14
    return top - height


def write(folder: Path) -> None:
    draw(folder / "house.png")
