"""The output of `colibri sitl`."""

import sys
from typing import Any, Literal

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table

_REDRAW_EVERY_S = 0.5
_SHOWN = ("compiling", "ground", "said", "heard", "silence", "answered", "refused", "flying", "error")
"""Events with a line of their own."""
_COLUMNS = dict(id=3, time=6, real=6, mode=10, rotors=8, east=6, north=6, up=7, speed=8, solver=6)
"""Least widths: enough for usual values, so that columns stay in place."""
_FIRST = ("id", "mode", "up", "rotors", "time", "speed", "east", "north", "real", "solver")
"""Columns by priority, for a narrow terminal."""
_LINKS_WIDTH = 66
"""Below this width, links are shown without scheme and rates."""


class StatusLines:
    def __init__(self, *, quiet: bool) -> None:
        self._console = Console(stderr=True, highlight=False, soft_wrap=True)
        self._facts: dict[int, dict[str, Any]] = {}
        self._quiet = quiet
        self._drawn_s = 0.0
        self._live: Live | None = None

    def begin(self, vehicles: int, note: str = "") -> None:
        if note and not self._quiet:
            self._console.print(note, markup=False)
        if self._console.is_terminal and not self._quiet:
            self._console.print("starting" + (f" {vehicles} vehicles" if vehicles > 1 else ""), markup=False)

    def add(self, instance: int, name: str, event: dict[str, Any]) -> None:
        if event["event"] == "status":
            self._facts[instance] = event
        elif event["event"] in _SHOWN and event.get("functions", 1) == 1 and not self._quiet:
            self._console.print(f"{instance + 1:3d} {name}: {event['text']}", markup=False)

    def died(self, instance: int, name: str, how: str) -> None:
        """Print a death, even if quiet."""
        self._console.print(f"{instance + 1:3d} {name} {how}", markup=False)

    def show(self, now_s: float) -> None:
        if self._quiet or not self._console.is_terminal or not self._facts or now_s < self._drawn_s + _REDRAW_EVERY_S:
            return
        self._drawn_s = now_s
        if self._live is None:
            self._live = Live(console=self._console, auto_refresh=False, transient=False)
            self._live.start()
        self._live.update(status_table(self._facts, self._console.width), refresh=True)

    def forget(self, instance: int) -> None:
        self._facts.pop(instance, None)

    def close(self) -> None:
        if self._live is not None:
            self._live.stop()
        sys.stderr.flush()


def status_table(facts: dict[int, dict[str, Any]], width: int = 80) -> Group:
    """Return a row per vehicle and per link; in a fleet, only links with a ground station."""
    shown = _shown(width)
    vehicles = Table(box=None, padding=(0, 1, 0, 0), header_style="dim")
    for heading in shown:
        side: Literal["left", "right"] = "left" if heading in ("mode", "rotors") else "right"
        vehicles.add_column(heading, no_wrap=True, min_width=_COLUMNS[heading], justify=side)
    links = Table(box=None, padding=(0, 2, 0, 0), show_header=False, style="dim")
    for column in range(5):
        links.add_column(no_wrap=True, justify="left" if column in (1, 2) else "right")
    for instance, fact in sorted(facts.items()):
        system = str(instance + 1)
        texts = dict(zip(_COLUMNS, (system, *_vehicle_texts(fact)), strict=True))
        vehicles.add_row(*(texts[heading] for heading in shown))
        for link in fact["links"]:
            if link["heard"] or len(facts) == 1:
                links.add_row(f"{system:>3}", *_link_texts(link, width))
    return Group(vehicles, links)


def _shown(width: int) -> list[str]:
    shown = [_FIRST[0]]
    for heading in _FIRST[1:]:
        if sum(_COLUMNS[each] + 1 for each in (*shown, heading)) > width:
            break
        shown.append(heading)
    return sorted(shown, key=[*_COLUMNS].index)


def _vehicle_texts(fact: dict[str, Any]) -> tuple[str, ...]:
    x, y, z = (round(value, 1) + 0.0 for value in fact["position_enu_m"])  # + 0.0: no minus before a zero
    return (
        f"{fact['sim_time_s']:.0f} s",
        f"x {fact['times_real_time']:.2f}",
        fact["mode"],
        "armed" if fact["armed"] else "disarmed",
        *(f"{x:.1f}", f"{y:.1f}", f"{z:.1f} m"),
        f"{fact['speed_m_s']:.1f} m/s",
        f"{fact['solve_time_us']:.0f} µs",
    )


def _link_texts(link: dict[str, Any], width: int) -> tuple[str, ...]:
    source = " ".join(["from", *link["heard"]]) if link["heard"] else "no client"
    if width < _LINKS_WIDTH:
        return (link["url"].partition(":")[2], source)
    return (link["url"], source, f"{link['received_hz']:.0f}/s in", f"{link['sent_hz']:.0f}/s out")
