"""`colibri arena`: fly a set by several laws."""

import json
from argparse import Namespace
from collections.abc import Iterator, Sequence
from contextlib import closing
from functools import cached_property
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from colibri.analysis.figures import GRID, TOP_IN, axes_grid, put_head, write_figure
from colibri.analysis.lost import LOST_M
from colibri.analysis.tables import Row as Cells
from colibri.analysis.tables import comma_separated, markdown, print_table
from colibri.arena.flights import MAX_STARTS, Arena, Published, Row
from colibri.autopilot.control.law_files import full_name, is_place, table_of
from colibri.autopilot.control.loop import build_controller
from colibri.autopilot.control.profile import load_profile, profile_names
from colibri.autopilot.control.registry import controller_names
from colibri.autopilot.spec import LawSpec
from colibri.campaigns.definition import Campaign, CampaignTables, Metric, campaign_of
from colibri.campaigns.factors import CampaignError, first_twice
from colibri.campaigns.figure import COLORS, make_room_for_names
from colibri.campaigns.flights import Verdict
from colibri.campaigns.gate import handed_over, with_limits
from colibri.campaigns.results import CampaignResults
from colibri.campaigns.run import FlightBar, engine_of, fly_campaign
from colibri.common.errors import unknown
from colibri.common.process.lifecycle import one_line
from colibri.conformance.subject import profile_for
from colibri.studies.comparison import contenders_of

CAP_M = LOST_M  # errors of a lost flight
_METRICS = ("mean_error_m", "rmse_m", "max_error_m", "control_step_us.p50", "max_tilt_deg", "track_duration_s")
METRICS = tuple(map(Metric, _METRICS))
_MM = 1e3
_MAX_COLUMNS = 3
_LEAST_MM = 0.1  # smallest error of the figure
_PUBLISHED = ("#777777", "#BBBBBB")


class Cell(NamedTuple):
    """The worst flights of a law in a row; errors in mm, a lost flight's at the cap."""

    flights: int
    lost: int
    mean_mm: float
    rms_mm: float
    largest_mm: float
    step_us: float
    tilt_deg: float
    track_s: float

    def __str__(self) -> str:
        mean = format(self.mean_mm, ".2f" if self.mean_mm < 1.0 else ".1f" if self.mean_mm < 100.0 else ".0f")
        return f"lost {self.lost} of {self.flights}" if self.lost else mean


class ArenaResults(CampaignResults):
    """The results of an arena, named after its set; the factors are `law` and `case`."""

    @cached_property
    def arena(self) -> Arena:
        return Arena(self.campaign.name)

    @cached_property
    def cells(self) -> dict[tuple[str, Row], Cell]:
        values = np.column_stack([self.metric(metric.name) for metric in METRICS])
        found: dict[tuple[str, str], list[int]] = {}
        for (law, case), places in self.groups().items():
            found.setdefault((law, case.rpartition(", start ")[0]), []).extend(places)
        laws = dict.fromkeys(law for law, _ in found)
        every = ((law, row) for law in laws for row in self.arena.set.rows())
        return {(law, row): self._cell(found[law, str(row)], values) for law, row in every if (law, str(row)) in found}

    def _cell(self, places: list[int], values: Any) -> Cell:
        away = np.array([self.flown[place].verdict is not Verdict.FLOWN for place in places])
        of_flights = values[places]
        of_flights[away, :3] = CAP_M
        worst = np.nanmax(of_flights, axis=0, initial=0.0) * (_MM, _MM, _MM, 1.0, 1.0, 1.0)
        return Cell(len(places), int(away.sum()), *(round(float(value), 3) for value in worst))

    def table(self) -> tuple[Cells, list[Cells]]:
        """Return mean errors, mm, a column for each law."""
        published = {
            (each.law, row): value for each in self.arena.set.published for row, value in self._published(each)
        }
        laws, others = (list(dict.fromkeys(law for law, _ in found)) for found in (self.cells, published))
        lines: list[Cells] = []
        for row, thrust in self._thrust.items():
            speed = f"{row.speed_m_s:g}" if row.speed_m_s else ""
            flown = (self._said(law, row) for law in laws)
            said = (f"{published[law, row]:g}" if (law, row) in published else "" for law in others)
            lines.append((row.track, speed, row.world, f"{thrust:.2f}", *flown, *said))
        return ("track", "m/s", "disturbance", "thrust", *laws, *others), lines

    def _said(self, law: str, row: Row) -> str:
        cell = self.cells.get((law, row))
        if cell is None or cell.lost or not self.arena.is_planned(row):
            return str(cell or "")
        return f"{cell} in {cell.track_s:.2f} s"

    def law_table(self) -> tuple[Cells, list[Cells]]:
        """Return rate, preview, lost flights and errors of each law."""
        lines: list[Cells] = []
        for level in self.campaign.grid["law"]:
            spec, vehicle = LawSpec(**level.settings), self.arena.vehicle()
            law = build_controller(spec.chosen(load_profile(spec.profile)), vehicle, perf_counter, spec.law)
            cells = [cell for (name, _), cell in self.cells.items() if name == level.name]
            if not cells:
                continue
            ahead_s = 1e-6 * law.preview.interval_us * (law.preview.samples - 1)
            lost = f"{sum(cell.lost for cell in cells)} of {sum(cell.flights for cell in cells)}"
            mean, most = np.mean([cell.mean_mm for cell in cells]), max(cell.largest_mm for cell in cells)
            figures = (f"{mean:.1f}", f"{most:.0f}", f"{np.median([cell.step_us for cell in cells]):.0f}")
            lines.append((level.name, f"{law.control_interval_us / 1e3:g}", f"{ahead_s:g}", lost, *figures))
        headings = ("law", "every (ms)", "preview (s)", "lost", "mean of rows (mm)", "largest (mm)", "step (µs)")
        return headings, lines

    @cached_property
    def _thrust(self) -> dict[Row, float]:
        return {row: round(self.arena.thrust(row), 3) for row in self.arena.set.rows()}

    def _published(self, each: Published) -> Iterator[tuple[Row, float]]:
        for track, values in each.mean_mm.items():
            for speed, value in zip(self.arena.set.speeds[track], values, strict=True):
                yield Row(track, speed, each.world), value

    def save(self, folder: str | Path, *, parquet: bool = False) -> Path:
        del parquet
        path = Path(folder)
        (path / "flights.csv").write_text(comma_separated(self.headings, self.rows()), encoding="utf-8")
        if not self.flown:
            return path
        rows = [
            {"law": law, **row._asdict(), "thrust": self._thrust[row], **cell._asdict()}
            for (law, row), cell in self.cells.items()
        ]
        sources = "".join(f"\n{each.law}: {each.source}.\n" for each in self.arena.set.published)
        text = f"{markdown(*self.table(), names=3)}\n{markdown(*self.law_table(), names=1)}{sources}"
        (path / "arena.md").write_text(text, encoding="utf-8")
        lines = [tuple(map(str, row.values())) for row in rows]
        (path / "arena.csv").write_text(comma_separated(tuple(rows[0]), lines), encoding="utf-8")
        facts = {"set": self.campaign.name, "cap_m": CAP_M, "rows": rows}
        (path / "arena.json").write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")
        write_figure(self.plot(), path / "arena")
        return path

    def plot(self, metric: str | None = None) -> Figure:
        """Return mean errors over speed, or over disturbances where tracks have one speed."""
        del metric
        by_speed = any(len(speeds) > 1 for speeds in self.arena.set.speeds.values())
        tracks = list(self.arena.set.tracks)
        columns = min(_MAX_COLUMNS if by_speed else 2, len(tracks))
        figure, grid = axes_grid(-(-len(tracks) // columns), columns, TOP_IN + 0.3, row_in=2.6, share=False)
        panels = [axes for line in grid for axes in line]
        for axes, name in zip(panels, tracks, strict=False):
            rows = [row for row in self._thrust if row.track == name]
            (self._over_speeds if by_speed else self._over_worlds)(axes, name, rows)
            axes.grid(**GRID)
            axes.set_title(name, fontsize="medium")
        for axes in panels[len(tracks) :]:
            axes.set_visible(False)
        figure.subplots_adjust(hspace=0.42)
        if not by_speed:
            make_room_for_names(figure, self.arena.set.worlds)
            figure.subplots_adjust(wspace=0.12)
            for axes in (axes for line in grid for axes in line[1:]):
                axes.tick_params(labelleft=False)
        shaded = "; shaded: more thrust than the rotors have" if by_speed else ""
        put_head(figure, f"Arena {Path(self.campaign.name).stem}: mean position error, worst start{shaded}", columns=5)
        return figure

    def _over_speeds(self, axes: Axes, name: str, rows: Sequence[Row]) -> None:
        for law, color, known in self._curves(rows):
            values = [self.cells[law, row].mean_mm for row in known]
            axes.plot([row.speed_m_s for row in known], values, label=law, color=color, marker="o", markersize=3)
        for each, color in zip(self.arena.set.published, _PUBLISHED, strict=False):
            values = [value for row, value in self._published(each) if row.track == name]
            style: dict[str, Any] = {"color": color, "linestyle": ":", "marker": "x"}
            axes.plot(self.arena.set.speeds[name], values, label=f"{each.law}, published", **style)
        for row in rows:
            if self._thrust[row] > 1.0:
                axes.axvspan(row.speed_m_s - 0.5, row.speed_m_s + 0.5, color="#D55E00", alpha=0.12, linewidth=0)
        axes.set_xticks(self.arena.set.speeds[name], [f"{speed:g}" for speed in self.arena.set.speeds[name]])
        axes.set_xlabel("top speed (m/s)")
        axes.set_ylabel("mean error (mm)")
        axes.set_yscale("log")
        axes.set_ylim(_LEAST_MM, 1.6 * _MM * CAP_M)
        axes.yaxis.set_major_formatter("{x:g}")

    def _over_worlds(self, axes: Axes, _name: str, rows: Sequence[Row]) -> None:
        curves = list(self._curves(rows))
        for number, (law, color, known) in enumerate(curves):
            shift = 0.5 * (number - 0.5 * (len(curves) - 1)) / len(curves)
            places = [rows.index(row) + shift for row in known]
            style: dict[str, Any] = {"color": color, "linestyle": "none", "marker": "o", "markersize": 4}
            axes.plot([self.cells[law, row].mean_mm for row in known], places, label=law, **style)
        axes.set_yticks(range(len(rows)), [row.world for row in rows])
        axes.set_ylim(len(rows) - 0.5, -0.5)
        axes.set_xlabel("mean error (mm)")
        axes.set_xscale("log")
        axes.set_xlim(_LEAST_MM, 1.6 * _MM * CAP_M)
        axes.xaxis.set_major_formatter("{x:g}")

    def _curves(self, rows: Sequence[Row]) -> Iterator[tuple[str, str, list[Row]]]:
        """Yield each law with its colour and the rows that it has flown."""
        for number, law in enumerate(dict.fromkeys(law for law, _ in self.cells)):
            yield law, COLORS[number % len(COLORS)], [row for row in rows if (law, row) in self.cells]


DEFAULT_LAWS = ("agile", "flight", "se3")


def arena(args: Namespace) -> int:
    """Fly each set in a folder of its name, and print its tables."""
    with one_line(kept=f"; finished flights are in {args.out}: continue with --resume"):
        laws, sets, code = laws_of(args.law or DEFAULT_LAWS), list(dict.fromkeys(args.sets)), 0
        if len(sets) > 1 and (args.json or args.junit):
            raise CampaignError(f'{"--json" if args.json else "--junit"}: takes one set, not "{" ".join(sets)}"')
        for name, planned in [(name, planned_of(name, laws, args.starts)) for name in sets]:
            planned = planned._replace(metrics=with_limits(planned.metrics, args.fail_above))
            out, engine = args.out / Path(name).stem, engine_of(args.workers, args.dask)
            with closing(FlightBar(name, planned.flights, quiet=args.quiet)) as bar:
                watch: dict[str, Any] = {"progress": bar.ended, "begun": bar.begun}
                results = fly_campaign(planned, engine, out, resume=args.resume, kind=ArenaResults, **watch)
            assert isinstance(results, ArenaResults)
            if not (args.quiet or args.json):
                print_table(f"{name}: worst mean error, mm; written to {out}", *results.table(), names=3)
                print_table(f"{name}: laws", *results.law_table(), names=1)
            code = max(code, handed_over(results, args))
        return code


def planned_of(name: str, laws: dict[str, dict[str, Any]], starts: int) -> Campaign:
    if not 1 <= starts <= MAX_STARTS:
        raise CampaignError(f'starts: must be 1 to {MAX_STARTS}, not "{starts}"')
    flown = Arena(name)
    cases = {f"{row}, start {start}": flown.settings(row, start) for row in flown.set.rows() for start in range(starts)}
    return campaign_of(CampaignTables(name=name, grid={"law": laws, "case": cases}, metrics=METRICS))


def laws_of(given: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return the levels of factor `law`, of `PROFILE[:CONTROLLER]`, a controller, or `FILE.py[:CLASS]`."""
    found: dict[str, dict[str, Any]] = {}
    if twice := first_twice(given):
        raise CampaignError(f'law: "{twice}" is given twice')
    for text in given:
        if ".toml" in text or text.partition(":")[0] in profile_names():
            found |= contenders_of([text])
        elif not is_place(text) and text not in controller_names():
            raise CampaignError(unknown("law", text, [*profile_names(), *controller_names(), "FILE.py[:CLASS]"]))
        else:
            law = full_name(text) if is_place(text) else text
            name = table_of(law)
            found[law if name in found else name] = {"profile": profile_for(law), "controller": text}
    return found
