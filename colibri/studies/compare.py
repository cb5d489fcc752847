"""`colibri compare`: controllers × tracks in one table, on the terminal, as Markdown and as CSV."""

import argparse
import json
from typing import NamedTuple

from colibri.analysis.outcome import Outcome, fly_to_its_end
from colibri.analysis.parallel import side_by_side
from colibri.analysis.recording import SETTLED_AFTER_S
from colibri.analysis.tables import print_table, write_table
from colibri.common.errors import Error
from colibri.common.process.lifecycle import EXIT_FAILED, fail
from colibri.flights.folder import make_folder
from colibri.flights.provenance import ProvenanceError, provenance_of, read_provenance
from colibri.studies.contenders import Job, jobs_of

COLUMNS = (
    *("controller", "track", "RMS (m)", "maximum (m)", "effort (N m)", "QP p50 (µs)", "QP p99 (µs)"),
    *("lost at (s)", "why"),
)
_UNKNOWN = "-"


class Row(NamedTuple):
    """A flight in the table.

    Attributes:
        cells: As in `COLUMNS`.
        lost: Whether the vehicle was.
    """

    cells: tuple[str, ...]
    lost: bool


def compare(args: argparse.Namespace) -> int:
    """Compare as the command line says; return 1 if a vehicle was lost."""
    try:
        jobs = jobs_of(args)
    except Error as error:
        fail(str(error))
    make_folder(args.out)
    kept = [kept_row(job) if args.resume else None for job in jobs]
    left = [job for job, row in zip(jobs, kept, strict=True) if row is None]
    if args.resume and not args.quiet:
        print(f"--resume: {len(jobs) - len(left)} of {len(jobs)} flights were flown already, by the same contents")  # noqa: T201
    flown = iter(side_by_side(row_of, left, "flights", quiet=args.quiet, worth=lambda _job: 1))
    rows = [next(flown) if row is None else row for row in kept]
    write_table(args.out / "compare", COLUMNS, [row.cells for row in rows], names=2)
    if not args.quiet:
        title = f"RMS after {SETTLED_AFTER_S:.0f} s; written to {args.out}"
        shown = len(COLUMNS) - (1 if any(row.lost for row in rows) else 2)
        print_table(title, COLUMNS[:shown], [row.cells[:shown] for row in rows], names=2)
        for row in rows:
            controller, track, *_, at_s, why = row.cells
            if why:
                print(f"{controller}, {track}: lost at t = {at_s} s: {why}")  # noqa: T201
    return EXIT_FAILED if any(row.lost for row in rows) else 0


def row_of(job: Job) -> Row:
    """Fly once; return the row of the table.

    RMS is that after the first 20 s, maximum that over the whole flight, its start beside the track included.
    """
    return _row(job, fly_to_its_end(job.plan(job.folder)))


def kept_row(job: Job) -> Row | None:
    """Return the row of a flight that was flown already, of the same contents; None if there is none."""
    try:
        if read_provenance(job.folder).sha256 != provenance_of(job.plan(job.folder)).sha256:
            return None
        return _row(job, Outcome(json.loads((job.folder / "report.json").read_text(encoding="utf-8")), ""))
    except (ProvenanceError, OSError, ValueError):
        return None


def _row(job: Job, outcome: Outcome) -> Row:
    figures = outcome.report
    if figures is None:
        return Row((job.contender.name, job.track, *[_UNKNOWN] * 5, "0", outcome.lost), lost=True)
    solve = figures["solve_time_us"]
    times = (_UNKNOWN,) * 2 if figures["solver"] is None else (f"{solve['p50']:.0f}", f"{solve['p99']:.0f}")
    rms, lost_at_s = figures["rmse_after_20s_m"], figures["lost_at_s"]
    errors = (_UNKNOWN if rms is None else f"{rms:.4g}", f"{figures['max_error_m']:.4g}")
    lost = ("", "") if lost_at_s is None else (f"{lost_at_s:.2f}", outcome.lost)
    cells = (job.contender.name, job.track, *errors, f"{figures['effort_n_m']:.4g}", *times, *lost)
    return Row(cells, lost=lost_at_s is not None)
