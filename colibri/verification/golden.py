"""`colibri verify --golden`: compare the golden flights with their recorded hashes."""

import argparse
import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import Annotated, NamedTuple

import msgspec

from colibri.common.config import UNREADABLE
from colibri.common.errors import Error, unknown
from colibri.common.files import read_bytes
from colibri.common.process.lifecycle import EXIT_FAILED, fail, one_line
from colibri.flights.folder import make_folder
from colibri.verification.cases import SHOWN, SitlCase, TrackCase, show_table
from colibri.verification.golden_flights import FLIGHTS

FOUND = "golden.json"
"""File of the results in the folder of the logs."""
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
    flights = chosen(args.only)
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
        _print(outcomes, known, args)
    differing = [outcome.name for outcome in outcomes if outcome.sha256 != known[outcome.name]]
    if differing:
        fail(f"not as in {path}: {', '.join(differing)}; the logs are in {args.out}", EXIT_FAILED)
    return 0


def chosen(names: Sequence[str]) -> list[TrackCase | SitlCase]:
    flights = {flight.name: flight for flight in FLIGHTS}
    for name in names:
        if name not in flights:
            fail(f"--only: {unknown('golden flight', name, flights)}")
    return [flight for flight in FLIGHTS if not names or flight.name in names]


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


def _print(outcomes: Sequence[GoldenResult], known: Mapping[str, str], args: argparse.Namespace) -> None:
    took_s = sum(outcome.wall_time_s for outcome in outcomes)
    title = f"{len(outcomes)} golden flights over {args.link} in {took_s:.0f} s; logs in {args.out}"
    rows = []
    for outcome in outcomes:
        expected = known[outcome.name]
        found = "the same" if outcome.sha256 == expected else outcome.sha256[:SHOWN] or outcome.error
        rows.append((outcome.name, f"{outcome.wall_time_s:.1f} s", expected[:SHOWN], found))
    show_table(title, ("flight", "took", "expected", "found"), rows)


def _print_changes(path: Path, old: Mapping[str, str], new: Mapping[str, str]) -> None:
    changed = [name for name in {**new, **old} if old.get(name) != new.get(name)]
    rows = [(name, *(hashes.get(name, _NO_HASH)[:SHOWN] for hashes in (old, new))) for name in changed]
    if changed:
        show_table(f"{path}: {len(changed)} of {len(new)} changed", ("flight", "was", "is"), rows)
    else:
        sys.stdout.write(f"{path}: nothing changed\n")
