"""`colibri compare`: contenders, which are profiles with controllers, and tracks in one table."""

import argparse
from collections import Counter
from collections.abc import Sequence
from contextlib import closing
from hashlib import sha256
from pathlib import Path
from urllib.parse import quote

import msgspec

from colibri.analysis.recording import SETTLED_AFTER_S
from colibri.analysis.tables import Row, print_table, write_table
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.guidance.trajectories.tracks import THESIS_TRACKS
from colibri.campaigns.definition import MAX_UNASKED, Campaign, CampaignTables, Logs, Point, campaign_of
from colibri.campaigns.engines.pool import Pool, with_bar
from colibri.campaigns.factors import CampaignError, shown
from colibri.campaigns.flight_table import FlightTable
from colibri.campaigns.flights import Common, FlightResult, Verdict, check, common_of, fly_points, plan_point
from colibri.campaigns.gate import handed_over, with_limits
from colibri.campaigns.journal import Journal, read_journal
from colibri.campaigns.metrics import Metric
from colibri.common.config import UNREADABLE
from colibri.common.files import read_bytes
from colibri.common.spec import keywords_of
from colibri.flights.folder import make_folder, prepare
from colibri.flights.provenance import provenance_of
from colibri.flights.spec import FlightSpec
from colibri.plant.vehicle.description import Vehicle

DEFAULT_PROFILES = ("thesis", "thesis-euler", "thesis:global-lpv-mpc", "se3")
_MAX_NAME = 200


def folder_of(contender: str, track: str) -> str:
    name = f"{quote(contender.replace(':', '-'), safe='')}-{folder_name(track)}"
    return name if len(name) <= _MAX_NAME else f"{name[:_MAX_NAME]}-{sha256(name.encode()).hexdigest()[:8]}"


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
    folder = f"flights/{folder_of(point.factors['contender'].name, point.factors['track'])}"
    return f"{folder}-{point.seed}" if by_seeds else folder


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
