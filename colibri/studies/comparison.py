"""`colibri compare`: contenders, which are profiles with controllers, and tracks in one table."""

import argparse
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import closing
from hashlib import sha256
from pathlib import Path
from typing import Any
from urllib.parse import quote

import msgspec
import numpy as np

from colibri.analysis.estimation import MEASURED, rms
from colibri.analysis.recording import SETTLED_AFTER_S
from colibri.analysis.tables import Row, comma_separated, print_table, write_table
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.guidance.trajectories.tracks import THESIS_TRACKS
from colibri.campaigns.definition import MAX_UNASKED, Campaign, CampaignTables, Logs, Metric, Point, campaign_of
from colibri.campaigns.engines import Pool, with_bar
from colibri.campaigns.factors import CampaignError, shown
from colibri.campaigns.flight_table import FlightTable
from colibri.campaigns.flights import Common, FlightResult, Verdict, check, common_of, fly_points, plan_point
from colibri.campaigns.gate import handed_over, with_limits
from colibri.campaigns.journal import Journal, read_journal
from colibri.common.config import UNREADABLE
from colibri.common.files import read_bytes
from colibri.common.process.lifecycle import one_line
from colibri.common.spec import keywords_of
from colibri.common.types import Array
from colibri.flights.folder import make_folder, occupied, prepare
from colibri.flights.provenance import provenance_of
from colibri.flights.spec import FlightSpec
from colibri.mavlink.hil.feedback import Feedback
from colibri.plant.vehicle.description import Vehicle

DEFAULT_PROFILES = ("thesis", "thesis-euler", "thesis:global-lpv-mpc", "se3")
_MAX_NAME = 200


def folder_name(track: str) -> str:
    return quote(track.replace(":", "-", 1), safe="=,")


def contenders_of(profiles: Sequence[str], controllers: Sequence[str] | None = None) -> dict[str, dict[str, str]]:
    """Return the contenders `NAME[:CONTROLLER]` by name, or by path where names coincide."""
    given: dict[tuple[str, str | None], None] = {}
    for text in profiles:
        head, toml, tail = text.partition(".toml")
        profile, _, controller = (head + toml, "", tail[1:]) if toml else text.partition(":")
        choices: Sequence[str | None] = [controller] if controller and profile else controllers or [None]
        given |= dict.fromkeys((profile or text, choice) for choice in choices)
    names = [load_profile(profile).name for profile, _ in given]
    called = Counter({(name, profile) for name, (profile, _) in zip(names, given, strict=True)})
    twice = Counter(name for name, _ in called)
    found = {}
    for name, (profile, law) in zip(names, given, strict=True):
        own = profile if twice[name] > 1 else name
        found[f"{own}:{law}" if law else own] = {"profile": profile} | ({"controller": law} if law else {})
    return found


def fly_comparison(args: argparse.Namespace, name: str, metrics: Sequence[Metric], logs: Logs) -> FlightTable:
    """Fly everything; `NAME-journal.jsonl` records each flight."""
    planned = _campaign(args, name, metrics, logs)
    if planned.flights > MAX_UNASKED:
        raise CampaignError(f"{planned.flights} flights exceed the limit of {MAX_UNASKED} are compared")
    common = common_of(planned)
    points = [point._replace(folder=_folder(point, by_seeds=bool(args.seeds))) for point in planned.points()]
    last = points[len(planned.seeds) - 1 :: len(planned.seeds)]
    notes = [*_different_vehicles(last, common), *check(last, common)]
    make_folder(args.out)
    if args.seeds:
        _keep_settings(args.out / f"{name}-settings.json", planned, resume=args.resume)
    journal = args.out / f"{name}-journal.jsonl"
    if not args.resume:
        journal.unlink(missing_ok=True)
    flown = _kept(journal, points, common)
    if args.resume and not (args.quiet or args.json):
        print(f"--resume: {len(flown)} of {len(points)} flights were flown already, by the same contents")  # noqa: T201
    left = [point for point in points if point.flight not in flown]
    with Journal(args.out, flown, journal.name) as kept:
        _fly(left, common, kept, args)
    for flight, _, _, folder in points:
        flown[flight] = flown[flight]._replace(why=flown[flight].why.replace(folder, str(args.out / folder)))
    return FlightTable(planned, flown, notes)


def _different_vehicles(points: Sequence[Point], common: Common) -> list[str]:
    plans = {point.factors["contender"].name: point for point in points}
    fly: dict[Vehicle, dict[str, str]] = {}
    for contender, plan in ((name, plan_point(common, point)) for name, point in plans.items()):
        fly.setdefault(plan.plant_vehicle, {})[contender] = plan.plant_vehicle_name
    if len(fly) < 2:
        return []
    words = (f"{', '.join(names)} on {next(iter(names.values()))}" for names in fly.values())
    return [f"different vehicles are compared: {'; '.join(words)}; --vehicle NAME is the same for all"]


def _campaign(args: argparse.Namespace, name: str, metrics: Sequence[Metric], logs: Logs) -> Campaign:
    names = set(keywords_of(FlightSpec)) - {"track", "profile", "controller", "seed"}
    options = {option: value for option, value in vars(args).items() if option in names}
    tables = CampaignTables(
        name=name,
        seeds=args.seeds or args.seed,
        fly=options,
        grid={
            "contender": contenders_of(args.profile or DEFAULT_PROFILES, args.controller),
            "track": list(dict.fromkeys(args.track or THESIS_TRACKS)),
        },
        metrics=metrics,
        logs=logs,
    )
    return campaign_of(tables)


def _folder(point: Point, *, by_seeds: bool) -> str:
    contender = point.factors["contender"].name.replace(":", "-")
    name = f"{quote(contender, safe='')}-{folder_name(point.factors['track'])}"
    if len(name) > _MAX_NAME:
        name = f"{name[:_MAX_NAME]}-{sha256(name.encode()).hexdigest()[:8]}"
    return f"flights/{name}-{point.seed}" if by_seeds else f"flights/{name}"


def _fly(points: Sequence[Point], common: Common, journal: Journal, args: argparse.Namespace) -> None:
    for point in points if common.logs == "all" else ():
        prepare(args.out / point.folder)
    with closing(fly_points(points, common, Pool())) as ended:
        for each in with_bar(ended, "flights", len(points), quiet=args.quiet or args.json):
            journal.add(each)


def _kept(file: Path, points: Sequence[Point], common: Common) -> dict[int, FlightResult]:
    kept = {each.contents: each for each in read_journal(file) if len(each.metrics) == len(common.metrics)}
    found = {}
    for point in points if kept else ():
        contents = provenance_of(plan_point(common, point)).sha256["all"]
        if contents in kept:
            found[point.flight] = kept[contents]._replace(flight=point.flight)
    return found


def _keep_settings(path: Path, planned: Campaign, *, resume: bool) -> None:
    now = {name: shown(value) for name, value in planned.fly.items()}
    if resume and path.exists():
        try:
            was = msgspec.json.decode(read_bytes(path), type=dict[str, str])
        except UNREADABLE as error:
            raise CampaignError(f"cannot read {path}: {error}; leave --resume out") from error
        changed = ", ".join(f"{name}={was.get(name)}, now {now[name]}" for name in now if was.get(name) != now[name])
        if changed:
            raise CampaignError(
                f"--resume: {path.parent} has flights by other settings ({changed}): give another --out"
            )
    path.write_bytes(msgspec.json.encode(now))


COLUMNS = (
    *("controller", "track", "RMS (m)", "maximum (m)", "effort (N m)", "QP p50 (µs)", "QP p99 (µs)"),
    *("lost at (s)", "why"),
)
_UNKNOWN = "-"


def _solve_time(quantile: str) -> Metric:
    return Metric(
        f"solve_time_us.{quantile}", lambda flight: flight.report["solver"] and flight.report["solve_time_us"][quantile]
    )


_METRICS = (
    *map(Metric, ("rmse_after_20s_m", "max_error_m", "effort_n_m")),
    *map(_solve_time, ("p50", "p99")),
    Metric("lost_at_s"),
)
_FORMATS = (".4g", ".4g", ".4g", ".0f", ".0f")


def compare(args: argparse.Namespace) -> int:
    with occupied(args.out), one_line():
        return _compare_seeds(args) if args.seeds else _compare(args)


def _compare(args: argparse.Namespace) -> int:
    """Compare; RMS excludes the first 20 s, the maximum does not."""
    table = fly_comparison(args, "compare", with_limits(_METRICS, args.fail_above), "all")
    rows = [(*names, *_cells(table.flown[place])) for names, (place,) in table.groups().items()]
    write_table(args.out / "compare", COLUMNS, rows, names=2, notes=table.notes)
    lost = any(row[-1] for row in rows)
    if not (args.quiet or args.json):
        title = f"RMS after {SETTLED_AFTER_S:.0f} s; written to {args.out}"
        shown = len(COLUMNS) - (1 if lost else 2)
        print_table(title, COLUMNS[:shown], [row[:shown] for row in rows], names=2)
        print(*table.notes, sep="\n", end="\n" if table.notes else "")  # noqa: T201
        for controller, track, *_, at_s, why in rows:
            if why:
                print(f"{controller}, {track}: lost at t = {at_s} s: {why}")  # noqa: T201
    return handed_over(table, args)


def _cells(flown: FlightResult) -> Row:
    *figures, lost_at_s = flown.metrics[: len(_METRICS)]
    cells = (_UNKNOWN if value is None else format(value, how) for value, how in zip(figures, _FORMATS, strict=True))
    if flown.verdict is Verdict.FLOWN:
        return (*cells, "", "")
    return (*cells, f"{lost_at_s:.2f}" if lost_at_s is not None else "0", flown.why)


SEED_HEADINGS = (
    *("profile", "track", "flights", "lost"),
    *("control (m)", "true (m)", "est. horizontal (m)", "est. vertical (m)", "roll (°)", "pitch (°)", "yaw (°)"),
    "NEES",
)
_WITHOUT_ESTIMATE = 5  # columns of a flight on the state
_SEED_ERRORS = (
    *("control_rmse_m", "rmse_after_20s_m", "estimation_rmse_m.horizontal", "estimation_rmse_m.vertical"),
    *("attitude_rmse_deg.roll", "attitude_rmse_deg.pitch", "attitude_rmse_deg.yaw"),
)
NEES = "nees_mean"


SEED_METRICS = (
    *map(Metric, (*_SEED_ERRORS, NEES)),
    *(Metric(f"nis_mean.{kind}.{figure}") for kind in MEASURED for figure in ("mean", "innovations")),
)
"""RMS of one flight after 20 s, m and degrees; mean NEES; by kind mean NIS, relative, and innovations."""


def _compare_seeds(args: argparse.Namespace) -> int:
    table = fly_comparison(args, "seeds", with_limits(SEED_METRICS, args.fail_above), "none")
    (args.out / "seeds-flights.csv").write_text(comma_separated(table.headings, table.rows()), encoding="utf-8")
    rows = [(*names, *_seed_cells(table, places)) for names, places in table.groups().items()]
    write_table(args.out / "seeds", SEED_HEADINGS, rows, names=2, notes=table.notes)
    from colibri.studies.seed_figures import draw_seeds

    draw_seeds(table, args.out)
    lost = [each for each in table.flown if each.verdict is not Verdict.FLOWN]
    if not (args.quiet or args.json):
        over = f"after {SETTLED_AFTER_S:.0f} s, root mean squares over all flights (largest of one)"
        shown = len(SEED_HEADINGS) if args.feedback is Feedback.SENSORS else _WITHOUT_ESTIMATE
        print_table(f"{over}; written to {args.out}", SEED_HEADINGS[:shown], [row[:shown] for row in rows], names=2)
        print(*table.notes, sep="\n", end="\n" if table.notes else "")  # noqa: T201
        for flown, row in zip(table.flown, table.rows(), strict=True):
            if flown in lost:
                print(f"{row[1]}, {row[2]}, seed {row[3]}: lost: {flown.why}")  # noqa: T201
    return handed_over(table, args)


def _seed_cells(table: FlightTable, places: Sequence[int]) -> Row:
    """Return RMS over flights, mean NEES, and in brackets the largest."""
    through = table.through(places)
    errors = (_seed_cell(table.metric(name)[through], rms) for name in _SEED_ERRORS)
    flown, lost = str(len(places)), str(len(places) - len(through))
    return (flown, lost, *errors, _seed_cell(table.metric(NEES)[through], np.mean))


def _seed_cell(column: Array, middle: Callable[[Array], Any]) -> str:
    if not len(column) or np.isnan(column).any():
        return "-"
    return f"{middle(column):.3g} ({column.max():.3g})"
