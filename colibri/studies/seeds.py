"""`colibri compare --seeds`: the same flights by many seeds, and how their errors are distributed."""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from colibri.analysis.estimation import MEASURED, rms
from colibri.analysis.outcome import keep_flight
from colibri.analysis.parallel import side_by_side
from colibri.analysis.report import SETTLED_AFTER_S
from colibri.analysis.tables import print_table, write_table
from colibri.autopilot.control.registry import load_controller
from colibri.autopilot.guidance.trajectories.tracks import THESIS_TRACKS
from colibri.common.errors import Error, InFlightError
from colibri.common.process.lifecycle import EXIT_FAILED, fail
from colibri.common.types import Array
from colibri.flights.fly import fly_plan, make_folder
from colibri.flights.plan import FlightPlan
from colibri.studies.seed_log import INNOVATIONS, QUANTITIES, FlightsLog, Flown, KeptError, kept_flights

DEFAULT_PROFILE = "flight"
LOST_M = 5.0
"""A vehicle further off its reference once settled is lost."""
HEADINGS = (
    *("profile", "track", "flights", "lost"),
    *("control (m)", "true (m)", "est. horizontal (m)", "est. vertical (m)", "roll (°)", "pitch (°)", "yaw (°)"),
    "NEES",
)


class Job(NamedTuple):
    """One flight.

    Attributes:
        contender: Profile, or profile:controller.
        track: What it flies.
        seed: Of everything random.
        args: The command line.
    """

    contender: str
    track: str
    seed: int
    args: argparse.Namespace

    def plan(self, out: Path) -> FlightPlan:
        """Return the flight as a plan."""
        profile, _, controller = self.contender.partition(":")
        chosen = {"profile": profile, "controller": controller or None, "track": self.track, "seed": self.seed}
        options = {name: getattr(self.args, name) for name in (*_COMMON, *_WEATHER)}
        return FlightPlan.of_options(out, **chosen, **options)


_COMMON = ("vehicle", "feedback", "link", "duration")
_WEATHER = ("wind", "gusts", "turbulence")
_KEPT_AS = {"gusts": "gust"}
_NO_INNOVATIONS = (0,) * len(MEASURED)


def compare_seeds(args: argparse.Namespace) -> int:
    """Fly every contender along every track by every seed; return 1 if one was lost."""
    contenders, tracks = args.profile or [DEFAULT_PROFILE], args.track or list(THESIS_TRACKS)
    jobs = [
        Job(contender, track, seed, args) for contender in contenders for track in tracks for seed in args.seeds or (0,)
    ]
    try:
        for job in jobs:
            load_controller(job.plan(args.out).profile.controller)
    except Error as error:
        fail(str(error))
    make_folder(args.out)
    try:
        flown = kept_flights(args.out, _settings(args)) if args.resume else {}
    except KeptError as error:
        fail(str(error))
    left = [job for job in jobs if (job.contender, job.track, job.seed) not in flown]
    with FlightsLog(args.out, _settings(args), flown.values()) as log:
        for each in side_by_side(fly_once, left, "flights", quiet=args.quiet, worth=lambda _job: 1, keep=log.add):
            flown[each.contender, each.track, each.seed] = each
    flights = [flown[job.contender, job.track, job.seed] for job in jobs]
    with FlightsLog(args.out, _settings(args), flights):
        pass  # once more, in their order
    rows = [
        _row([flown for flown in flights if (flown.contender, flown.track) == (contender, track)])
        for contender in contenders
        for track in tracks
    ]
    write_table(args.out / "seeds", HEADINGS, rows, names=2)
    from colibri.studies.seed_figures import draw_seeds

    draw_seeds(flights, args.out)
    if not args.quiet:
        over = f"after {SETTLED_AFTER_S:.0f} s, root mean squares over all flights (largest of one)"
        print_table(f"{over}; written to {args.out}", HEADINGS, rows, names=2)
    return EXIT_FAILED if any(flown.lost for flown in flights) else 0


def fly_once(job: Job) -> Flown:
    """Fly a job, keep its figures and forget its logs."""
    with TemporaryDirectory() as folder:
        plan = job.plan(Path(folder))
        try:
            _, figures = keep_flight(plan, fly_plan(plan))
        except InFlightError as error:
            return Flown(
                job.contender, job.track, job.seed, str(error), (np.nan,) * len(QUANTITIES), _NO_INNOVATIONS, ""
            )
    values, sha256 = _values(figures), figures["trajectory_sha256"]
    lost = f"{values[1]:.1f} m off" if values[1] > LOST_M or figures["max_error_after_20s_m"] > LOST_M else ""
    nis = figures["nis_mean"]
    innovations = _NO_INNOVATIONS if nis is None else _of_each(nis, "innovations", 0)
    return Flown(job.contender, job.track, job.seed, lost, values, innovations, sha256)


def _values(figures: dict[str, Any]) -> tuple[float, ...]:
    off, turned = figures["estimation_rmse_m"], figures["attitude_rmse_deg"]
    estimated = (np.nan,) * 5 if off is None else (*off.values(), *turned.values())
    nees, nis = figures["nees_mean"], figures["nis_mean"]
    means = (None,) * len(MEASURED) if nis is None else _of_each(nis, "mean", None)
    normalised = (np.nan if value is None else value for value in (nees, *means))
    return (figures["control_rmse_m"], figures["rmse_after_20s_m"], *estimated, *normalised)


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
    return " ".join(f"{_KEPT_AS.get(name, name)}={getattr(args, name)}" for name in (*_COMMON, *_WEATHER))
