"""`colibri compare`: controllers × tracks in one table, on the terminal, as Markdown and as CSV."""

import argparse
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

from colibri.analysis.outcome import keep_flight
from colibri.analysis.parallel import side_by_side
from colibri.analysis.report import SETTLED_AFTER_S
from colibri.analysis.tables import print_table, write_table
from colibri.autopilot.control.registry import load_controller
from colibri.autopilot.guidance.trajectories.tracks import THESIS_TRACKS
from colibri.common.errors import Error
from colibri.common.process.lifecycle import fail
from colibri.flights.fly import make_folder, prepare
from colibri.flights.in_process import fly_locally
from colibri.flights.plan import FlightPlan

DEFAULT_PROFILES = ("thesis", "thesis-euler", "thesis:global-lpv-mpc", "se3")
COLUMNS = ("controller", "track", "RMS (m)", "maximum (m)", "effort (N m)", "QP p50 (µs)", "QP p99 (µs)")


class Job(NamedTuple):
    """One flight of the comparison."""

    contender: str
    track: str
    link: str
    out: Path

    def plan(self) -> FlightPlan:
        """Return the flight as a plan."""
        profile, _, controller = self.contender.partition(":")
        folder = self.out / "flights" / f"{self.contender.replace(':', '-')}-{folder_name(self.track)}"
        return FlightPlan.of_options(
            folder, track=self.track, profile=profile, controller=controller or None, link=self.link
        )


def compare(args: argparse.Namespace) -> int:
    """Compare as the command line says; return the exit code."""
    contenders, tracks = args.profile or DEFAULT_PROFILES, args.track or list(THESIS_TRACKS)
    jobs = [Job(contender, track, args.link, args.out) for contender in contenders for track in tracks]
    try:
        for job in jobs:
            load_controller(job.plan().profile.controller)
    except Error as error:
        fail(str(error))
    make_folder(args.out)
    rows = side_by_side(row_of, jobs, "flights", quiet=args.quiet, worth=lambda _job: 1)
    write_table(args.out / "compare", COLUMNS, rows, names=2)
    if not args.quiet:
        title = f"RMS after {SETTLED_AFTER_S:.0f} s; written to {args.out}"
        print_table(title, COLUMNS, rows, names=2)
    return 0


def row_of(job: Job) -> tuple[str, ...]:
    """Fly once; return the row of the table.

    RMS is that after the first 20 s, maximum that over the whole flight, its start beside the track included.
    """
    plan = job.plan()
    prepare(plan.out)
    _, figures = keep_flight(plan, fly_locally(plan))
    return (job.contender, job.track, *_cells(figures))


def folder_name(track: str) -> str:
    """Return a track's name with its options as the name of a folder, one that no other track has."""
    return quote(track.replace(":", "-", 1), safe="=,")


def _cells(figures: dict[str, Any]) -> tuple[str, ...]:
    solve = figures["solve_time_us"]
    times = ("-", "-") if figures["solver"] is None else (f"{solve['p50']:.0f}", f"{solve['p99']:.0f}")
    rms, maximum = figures["rmse_after_20s_m"], figures["max_error_m"]
    return (f"{rms:.4g}", f"{maximum:.4g}", f"{figures['effort_n_m']:.4g}", *times)
