"""What `colibri sitl` shows: one live line a vehicle on a terminal, and a line for each thing that happens."""

import sys
from typing import Any

from rich.console import Console
from rich.live import Live
from rich.table import Table

_REDRAW_EVERY_S = 0.5
_TOLD = ("listening", "ground", "said", "heard", "silence", "answered", "refused", "flying")
"""Events that get a line of their own."""


class StatusLines:
    """Collects what the processes say, and draws it."""

    def __init__(self, *, quiet: bool) -> None:
        """Draw on standard error; `quiet`: only what happens, no live line."""
        self._console = Console(stderr=True, highlight=False, soft_wrap=True)
        self._facts: dict[int, dict[str, Any]] = {}
        self._quiet = quiet
        self._drawn_s = 0.0
        self._live: Live | None = None

    def hear(self, instance: int, name: str, event: dict[str, Any]) -> None:
        """Take in one event of a process of vehicle `instance`."""
        if event["event"] == "status":
            self._facts[instance] = event
        elif event["event"] in _TOLD and not self._quiet:
            self._console.print(f"{instance + 1:3d} {name}: {event['text']}", markup=False)

    def show(self, now_s: float) -> None:
        """Draw the live lines, if it is time to and there is a terminal."""
        if self._quiet or not self._console.is_terminal or not self._facts or now_s < self._drawn_s + _REDRAW_EVERY_S:
            return
        self._drawn_s = now_s
        if self._live is None:
            self._live = Live(console=self._console, auto_refresh=False, transient=False)
            self._live.start()
        self._live.update(status_table(self._facts), refresh=True)

    def close(self) -> None:
        """Leave the terminal as it was."""
        if self._live is not None:
            self._live.stop()
        sys.stderr.flush()


def status_table(facts: dict[int, dict[str, Any]]) -> Table:
    """Return one row a vehicle: what it does, where it is, who listens, how long the control law takes."""
    table = Table(box=None, pad_edge=False, header_style="dim")
    for heading in ("id", "time", "× real", "mode", "", "east north up", "speed", "solver", "ground stations"):
        table.add_column(heading, no_wrap=True)
    for instance, fact in sorted(facts.items()):
        x, y, z = fact["position_enu_m"]
        table.add_row(
            str(instance + 1),
            f"{fact['sim_time_s']:.0f} s",
            f"{fact['times_real_time']:.2f}",
            fact["mode"],
            "armed" if fact["armed"] else "disarmed",
            f"{x:.1f} {y:.1f} {z:.1f} m",
            f"{fact['speed_m_s']:.1f} m/s",
            f"{fact['solve_time_us']:.0f} µs",
            ", ".join(link_text(link) for link in fact["links"]),
        )
    return table


def link_text(link: dict[str, Any]) -> str:
    """Return a link in words: who is heard on it, and messages a second in and out."""
    who = " ".join(link["heard"]) or "nobody"
    return f"{link['url']} {who} (in {link['received_hz']:.0f}, out {link['sent_hz']:.0f} /s)"
