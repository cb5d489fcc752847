"""`colibri verify`: fly cases three times and replay them, or the golden flights once; compare all bits."""

import argparse
import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Annotated, NamedTuple

import msgspec

from colibri.analysis.tables import print_table
from colibri.common.config import UNREADABLE
from colibri.common.errors import Error
from colibri.common.files import read_bytes
from colibri.common.process.arguments import chosen
from colibri.common.process.lifecycle import EXIT_FAILED, fail, one_line
from colibri.flights.fly import FlightError
from colibri.flights.folder import make_folder
from colibri.flights.replay import replay_flight
from colibri.mavlink.hil.feedback import Feedback
from colibri.verification.golden_flights import FLIGHTS, SHOWN, SitlCase, TrackCase

FOUND = "golden.json"  # file of the results in the folder of the logs
_NO_HASH = "-"

_Hash = Annotated[str, msgspec.Meta(pattern="^[0-9a-f]{64}$")]


class GoldenResult(NamedTuple):
    """The result of a golden flight; without a hash it has failed."""

    name: str
    sha256: str
    wall_time_s: float
    error: str = ""


def verify_golden(args: argparse.Namespace) -> int:
    if args.duration is not None:
        fail("--duration cannot be combined with --golden: each golden flight has its own")
    path: Path = args.golden
    flights = chosen("golden flight", args.only, {flight.name: flight for flight in FLIGHTS}, "--only: ")
    known = read_hashes(path) if path.exists() or not args.renew else {}
    if not args.renew:
        _check_names(path, known)
    make_folder(args.out)
    with one_line(EXIT_FAILED, f"; logs are in {args.out}"):
        outcomes = [fly_golden(flight, args.out / flight.name, args.link) for flight in flights]
    found = {outcome.name: outcome._asdict() for outcome in outcomes}
    (args.out / FOUND).write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    if args.renew:
        return _renew(args, known, outcomes)
    if not args.quiet:
        _print_golden(outcomes, known, args)
    differing = [outcome.name for outcome in outcomes if outcome.sha256 != known[outcome.name]]
    if differing:
        fail(f"not as in {path}: {', '.join(differing)}; the logs are in {args.out}", EXIT_FAILED)
    return 0


def fly_golden(flight: TrackCase | SitlCase, out: Path, link: str) -> GoldenResult:
    began_s = perf_counter()
    try:
        sha256, error = flight.fly(out, link), ""
    except Error as failure:
        sha256, error = "", str(failure)
    return GoldenResult(flight.name, sha256, perf_counter() - began_s, error)


def read_hashes(path: Path) -> dict[str, str]:
    try:
        return msgspec.json.decode(read_bytes(path), type=dict[str, _Hash])
    except FileNotFoundError:
        fail(f"no golden hashes in {path}: name their FILE, or write them with --renew")
    except OSError as error:
        fail(f"cannot read {path}: {error.strerror}")
    except UNREADABLE as error:
        fail(f"{path} holds no golden hashes, names and SHA-256 as one JSON object: {error}")


def _check_names(path: Path, known: Mapping[str, str]) -> None:
    names = {flight.name for flight in FLIGHTS}
    wrong = [f"names {name}, which is not a golden flight" for name in sorted(known.keys() - names)]
    wrong += [f"has no hash of golden flight {name}" for name in sorted(names - known.keys())]
    if wrong:
        fail(f"{path} {wrong[0]}: write it again with --renew")


def _renew(args: argparse.Namespace, known: Mapping[str, str], outcomes: Iterable[GoldenResult]) -> int:
    path: Path = args.golden
    lost = [outcome for outcome in outcomes if outcome.error]
    if lost:
        fail(f"{lost[0].name} did not end, and {path} stays as it is: {lost[0].error}", EXIT_FAILED)
    latest = {**known, **{outcome.name: outcome.sha256 for outcome in outcomes}}
    hashes = {flight.name: latest[flight.name] for flight in FLIGHTS if flight.name in latest}
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(hashes, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        fail(f"cannot write {path}: {error.strerror}")
    if not args.quiet:
        _print_changes(path, known, hashes)
    return 0


def _print_golden(outcomes: Sequence[GoldenResult], known: Mapping[str, str], args: argparse.Namespace) -> None:
    took_s = sum(outcome.wall_time_s for outcome in outcomes)
    title = f"{len(outcomes)} golden flights over {args.link} in {took_s:.0f} s; logs in {args.out}"
    rows = []
    for outcome in outcomes:
        expected = known[outcome.name]
        found = "the same" if outcome.sha256 == expected else outcome.sha256[:SHOWN] or outcome.error
        rows.append((outcome.name, f"{outcome.wall_time_s:.1f} s", expected[:SHOWN], found))
    print_table(title, ("flight", "took", "expected", "found"), rows, names=4)


def _print_changes(path: Path, old: Mapping[str, str], new: Mapping[str, str]) -> None:
    changed = [name for name in {**new, **old} if old.get(name) != new.get(name)]
    rows = [(name, *(hashes.get(name, _NO_HASH)[:SHOWN] for hashes in (old, new))) for name in changed]
    if changed:
        print_table(f"{path}: {len(changed)} of {len(new)} changed", ("flight", "was", "is"), rows, names=3)
    else:
        sys.stdout.write(f"{path}: nothing changed\n")


DEFAULT_DURATION_S = 20.0

SENSORS, MODERATE = {"profile": "flight", "feedback": Feedback.SENSORS}, {"turbulence": "moderate"}
CASES = (
    TrackCase("thesis-spiral", {"track": "spiral", "profile": "thesis"}),
    TrackCase("spiral", {"track": "spiral", "profile": "flight"}),
    TrackCase("lemniscate-in-gusts", {"track": "lemniscate", "profile": "flight", "wind": "5@270", **MODERATE}),
    TrackCase("circle-by-se3", {"track": "circle", "profile": "se3"}),
    TrackCase("spiral-on-sensors", {"track": "spiral", **SENSORS}),
    TrackCase("wave-on-sensors-in-gusts", {"track": "wave", **SENSORS, "wind": "8@270", **MODERATE}),
)
SEED = 7


class CaseResult(NamedTuple):
    name: str
    hashes: tuple[str, str, str]
    commands: int
    replays: bool

    @property
    def same(self) -> bool:
        return len(set(self.hashes)) == 1 and self.replays


def verify(args: argparse.Namespace) -> int:
    if args.golden is not None:
        return verify_golden(args)
    if args.renew or args.only:
        fail(f"--{'renew' if args.renew else 'only'} goes with --golden alone")
    if args.duration is None:
        args.duration = DEFAULT_DURATION_S
    with one_line(EXIT_FAILED, f"; logs are in {args.out}"):
        try:
            verdicts = [_verdict(case, args) for case in CASES]
        except FlightError as error:
            fail(str(error), error.code)
    if not args.quiet:
        _print(verdicts, args)
    differing = [verdict.name for verdict in verdicts if not verdict.same]
    if differing:
        fail(f"not the same twice: {', '.join(differing)}; the logs are in {args.out}", EXIT_FAILED)
    return 0


def _verdict(case: TrackCase, args: argparse.Namespace) -> CaseResult:
    folder: Path = args.out / case.name
    fly = partial(case.fly, duration=args.duration, seed=SEED)
    first, second = (fly(folder / again, args.link) for again in ("first", "second"))
    third = fly(folder / "memory", "memory")
    replayed = replay_flight(folder / "first")
    return CaseResult(case.name, (first, second, third), replayed.commands, replayed.difference is None)


def _print(verdicts: list[CaseResult], args: argparse.Namespace) -> None:
    title = f"{args.duration:g} s, seed {SEED}, twice over {args.link} and once in memory; logs in {args.out}"
    rows = []
    for verdict in verdicts:
        replayed = f"{verdict.commands} commands" if verdict.replays else "differs"
        hashes = dict.fromkeys(sha256[:SHOWN] for sha256 in verdict.hashes)
        rows.append((verdict.name, "\n".join(hashes), replayed, "yes" if verdict.same else "NO"))
    print_table(title, ("flight", "trajectory", "replayed", "the same"), rows, names=4)
