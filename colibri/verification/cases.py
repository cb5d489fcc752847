"""Named flights."""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from colibri.analysis.outcome import keep_flight
from colibri.flights.fly import fly_plan
from colibri.flights.folder import prepare
from colibri.flights.plan import FlightPlan
from colibri.flights.spec import FlightSpec
from colibri.sitl.backends.setting import setting_of

if TYPE_CHECKING:
    from colibri.sitl.vehicle import Sitl

_WAYPOINTS_FILE = "waypoints.csv"


class TrackCase(NamedTuple):
    """A flight along a track, by options of `colibri fly`."""

    name: str
    options: dict[str, Any]
    waypoints: str = ""

    def plan(self, out: Path, **more: Any) -> FlightPlan:
        track = {"track": f"waypoints:{out / _WAYPOINTS_FILE}"} if self.waypoints else {}
        return FlightPlan.of(FlightSpec.of(**(self.options | track | {"out": out} | more)))

    def fly(self, out: Path, link: str, **more: Any) -> str:
        """Return the hash of the trajectory; logs are in `out`."""
        prepare(out)
        if self.waypoints:
            (out / _WAYPOINTS_FILE).write_text(self.waypoints, encoding="utf-8")
        plan = self.plan(out, **more, link=link)
        figures = keep_flight(plan, fly_plan(plan))
        sha256: str = figures["trajectory_sha256"]
        return sha256


class SitlCase(NamedTuple):
    """A flight commanded by a ground station, by keys of `Setting`."""

    name: str
    orders: "Callable[[Sitl], object]"
    setting: Mapping[str, Any] = {}

    def fly(self, out: Path, link: str) -> str:
        """Return the hash of all truth and commands; logs are in `out`."""
        from colibri.sitl.backends.launcher import Launcher
        from colibri.sitl.session import Flights

        begun = Launcher(from_scratch=True) if link == "udp" else None
        with Flights(setting_of([self.setting]), begun) as flights:
            try:
                sitl = flights.begin()
                self.orders(sitl)
            finally:
                flights.keep(out, figures=False)
        return sitl.sha256


SHOWN = 16
"""Characters of a hash in tables."""


def show_table(title: str, headings: Iterable[str], rows: Iterable[Iterable[str]]) -> None:
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=escape(title), title_justify="left")
    *names, last = headings
    for heading in names:
        table.add_column(heading, no_wrap=True)
    table.add_column(last, min_width=SHOWN)  # an error may be longer than the line
    for row in rows:
        table.add_row(*map(escape, row))
    Console().print(table)
