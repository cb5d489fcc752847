"""`colibri compare --seeds`: the same flights by many seeds, and how their errors are distributed."""

import argparse
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from colibri.analysis.estimation import MEASURED, rms
from colibri.analysis.outcome import fly_to_its_end
from colibri.analysis.parallel import side_by_side
from colibri.analysis.recording import SETTLED_AFTER_S
from colibri.analysis.tables import print_table, write_table
from colibri.common.errors import Error
from colibri.common.process.failure_file import FAILURE
from colibri.common.process.lifecycle import EXIT_FAILED, fail
from colibri.common.types import Array
from colibri.flights.folder import make_folder
from colibri.flights.plan import OPTIONS
from colibri.flights.provenance import provenance_of
from colibri.mavlink.hil.feedback import Feedback
from colibri.studies.contenders import Job, jobs_of
from colibri.studies.seed_log import INNOVATIONS, QUANTITIES, FlightsLog, Flown, kept_flights

HEADINGS = (
    *("profile", "track", "flights", "lost"),
    *("control (m)", "true (m)", "est. horizontal (m)", "est. vertical (m)", "roll (°)", "pitch (°)", "yaw (°)"),
    "NEES",
)
_WITHOUT_ESTIMATE = 5
"""So many of them say something of a flight on the state, where control and true error are the same."""
_NO_INNOVATIONS = (0,) * len(MEASURED)


def compare_seeds(args: argparse.Namespace) -> int:
    """Fly every contender along every track by every seed; return 1 if one was lost."""
    try:
        jobs = jobs_of(args)
        contents = {_key(job): provenance_of(job.plan(args.out)).sha256["all"] for job in jobs}
        make_folder(args.out)
        flown = kept_flights(args.out, _settings(args)) if args.resume else {}
    except Error as error:
        fail(str(error))
    same = {key: each for key, each in flown.items() if contents.get(key, each.contents) == each.contents}
    if len(same) < len(flown) and not args.quiet:
        print(f"--resume: {len(flown) - len(same)} of {len(flown)} flights are flown again, by contents that changed")  # noqa: T201
    left = [job for job in jobs if _key(job) not in same]
    with FlightsLog(args.out, _settings(args), same.values()) as log:
        for each in side_by_side(fly_once, left, "flights", quiet=args.quiet, worth=lambda _job: 1, keep=log.add):
            same[each.contender, each.track, each.seed] = each
    flights = [same[_key(job)] for job in jobs]
    with FlightsLog(args.out, _settings(args), flights):
        pass  # once more, in their order
    cases = dict.fromkeys((flown.contender, flown.track) for flown in flights)
    rows = [_row([flown for flown in flights if (flown.contender, flown.track) == case]) for case in cases]
    write_table(args.out / "seeds", HEADINGS, rows, names=2)
    from colibri.studies.seed_figures import draw_seeds

    draw_seeds(flights, args.out)
    if not args.quiet:
        over = f"after {SETTLED_AFTER_S:.0f} s, root mean squares over all flights (largest of one)"
        shown = len(HEADINGS) if args.feedback is Feedback.SENSORS else _WITHOUT_ESTIMATE
        print_table(f"{over}; written to {args.out}", HEADINGS[:shown], [row[:shown] for row in rows], names=2)
        for each in flights:
            if each.lost:
                print(f"{each.contender}, {each.track}, seed {each.seed}: lost: {each.lost}")  # noqa: T201
    return EXIT_FAILED if any(flown.lost for flown in flights) else 0


def fly_once(job: Job) -> Flown:
    """Fly a job, keep its figures and forget its logs; of a flight that came to an early end keep why."""
    with TemporaryDirectory() as folder:
        plan = job.plan(Path(folder))
        contents = provenance_of(plan).sha256["all"]
        outcome = fly_to_its_end(plan)
        if outcome.failure or outcome.report is None:
            lost = outcome.failure.replace(str(plan.out), str(_keep_failure(job, plan.out)))
            return Flown(*_key(job), lost, (np.nan,) * len(QUANTITIES), _NO_INNOVATIONS, "", contents)
    figures = outcome.report
    nis = figures["nis_mean"]
    innovations = _NO_INNOVATIONS if nis is None else _of_each(nis, "innovations", 0)
    return Flown(*_key(job), outcome.lost, _values(figures), innovations, figures["trajectory_sha256"], contents)


def _key(job: Job) -> tuple[str, str, int]:
    return job.contender.name, job.track, job.seed


def _keep_failure(job: Job, folder: Path) -> Path:
    """Keep the traceback of a flight, if there is one; return the folder that it is in then."""
    kept = job.folder.with_name(f"{job.folder.name}-{job.seed}")
    with suppress(OSError):
        text = (folder / FAILURE).read_text(encoding="utf-8")
        kept.mkdir(parents=True, exist_ok=True)
        (kept / FAILURE).write_text(text.replace(str(folder), str(kept)), encoding="utf-8")
    return kept


def _values(figures: dict[str, Any]) -> tuple[float, ...]:
    """Return `QUANTITIES` of a flight; nan of what a report does not have, that of a flight that never settled say."""
    off, turned = figures["estimation_rmse_m"], figures["attitude_rmse_deg"]
    estimated = (None,) * 5 if off is None else (*off.values(), *turned.values())
    nees, nis = figures["nees_mean"], figures["nis_mean"]
    means = (None,) * len(MEASURED) if nis is None else _of_each(nis, "mean", None)
    values = (figures["control_rmse_m"], figures["rmse_after_20s_m"], *estimated, nees, *means)
    return tuple(np.nan if value is None else value for value in values)


def _of_each(nis: dict[str, dict[str, Any]], figure: str, without: Any) -> tuple[Any, ...]:
    """Return a figure of each of `MEASURED`; `without` of what the vehicle does not measure."""
    return tuple(nis[kind][figure] if kind in nis else without for kind in MEASURED)


def _row(flights: Sequence[Flown]) -> tuple[str, ...]:
    """Return root mean squares over the flights, of NEES the mean, and the largest of one flight in brackets."""
    values = np.array([flown.values for flown in flights if not flown.lost]).reshape(-1, len(QUANTITIES))
    lost = sum(bool(flown.lost) for flown in flights)
    *errors, nees = values.T[: -len(INNOVATIONS)]
    cells = [*(_cell(column, rms) for column in errors), _cell(nees, np.mean)]
    return (flights[0].contender, flights[0].track, str(len(flights)), str(lost), *cells)


def _cell(column: Array, middle: Callable[[Array], Any]) -> str:
    if not len(column) or np.isnan(column).any():
        return "-"
    return f"{middle(column):.3g} ({column.max():.3g})"


def _settings(args: argparse.Namespace) -> str:
    """Return what every flight of a comparison has in common."""
    return " ".join(f"{name}={getattr(args, name)}" for name in ("link", *OPTIONS) if name != "seed")
