"""`colibri verify`: fly each case three times and replay it; compare all bits."""

import argparse
from functools import partial
from pathlib import Path
from typing import NamedTuple

from colibri.common.process.lifecycle import EXIT_FAILED, fail, one_line
from colibri.flights.fly import FlightError
from colibri.flights.replay import replay_flight
from colibri.mavlink.hil.feedback import Feedback
from colibri.verification.cases import SHOWN, TrackCase, show_table
from colibri.verification.golden import verify_golden

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
    show_table(title, ("flight", "trajectory", "replayed", "the same"), rows)
