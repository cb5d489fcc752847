"""`python -m tools.chaos`: exceptions thrown into every place, at many instants of every situation, each in a fork."""

import argparse
import json
import os
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from math import inf
from pathlib import Path
from time import perf_counter
from typing import Any

from colibri.mavlink.hil.feedback import Feedback
from colibri.sitl.vehicle import Sitl
from tools.chaos.flights import PLACES, SITUATIONS, ChaosFlight, Thrower, airborne

SPAN_S = 4.8
"""Over which the instants of a situation are spread."""
TIMES = (1.0, inf)
"""Exceptions from an instant on: one, or all."""


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.chaos", description=__doc__)
    parser.add_argument("--instants", type=int, default=20, help="of each situation (default %(default)s)")
    parser.add_argument("--place", action="append", default=[], metavar="NAME", help="only places that contain this")
    parser.add_argument("--table", type=Path, metavar="FILE", help="write the table there, as Markdown")
    args = parser.parse_args()
    places = [place for place in PLACES if not args.place or any(name in place for name in args.place)]
    started_s, cases = perf_counter(), []
    for case in _side_by_side(places, args.instants):
        cases.append(case)
        if case["bad"]:
            print(f"FAILED: {case}", flush=True)
    lines = table(cases)
    flown = sum(case["outcome"] != "not reached" for case in cases)
    failed = sum(case["bad"] for case in cases)
    lines += ["", f"{flown} flights with exceptions thrown, {failed} failed; {perf_counter() - started_s:.0f} s"]
    print(*lines, sep="\n")
    if args.table:
        args.table.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return 1 if failed or not flown else 0


def table(cases: list[dict[str, Any]]) -> list[str]:
    outcomes: dict[str, dict[str, Counter[str]]] = defaultdict(lambda: defaultdict(Counter))
    said: dict[str, Counter[str]] = defaultdict(Counter)
    for case in cases:
        if case["outcome"] != "not reached":
            outcomes[case["place"]][case["situation"]][case["outcome"]] += 1
            said[case["place"]][case["said"]] += 1
    lines = [f"| place | {' | '.join(SITUATIONS)} | said |", "|---" * (len(SITUATIONS) + 2) + "|"]
    for place, row in outcomes.items():
        cells = [", ".join(f"{n} {what}" for what, n in sorted(row[name].items())) or "–" for name in SITUATIONS]
        ((text, _),) = said[place].most_common(1)
        lines.append(f"| `{place.partition(':')[2]}` | {' | '.join(cells)} | {text} |")
    return lines


def _side_by_side(places: list[str], instants: int) -> Iterator[dict[str, Any]]:
    reading, writing = os.pipe()
    children = []
    for feedback in Feedback:
        pid = os.fork()
        if pid == 0:
            os.close(reading)
            with airborne(feedback) as flight:
                _fly_situations(flight, feedback, places, instants, writing)
            os._exit(0)
        children.append(pid)
    os.close(writing)
    with os.fdopen(reading, encoding="utf-8") as lines:
        for line in lines:
            yield json.loads(line)
    for pid in children:
        if os.waitpid(pid, 0)[1] != 0:
            raise RuntimeError("a process of the campaign has died")


def _fly_situations(flight: Sitl, feedback: Feedback, places: list[str], instants: int, out: int) -> None:
    for situation, prepare in SITUATIONS.items():
        pid = os.fork()
        if pid == 0:
            prepare(flight)
            for instant in range(instants):
                for place in places:
                    _fly(
                        flight, place, TIMES[instant % len(TIMES)], {"feedback": feedback, "situation": situation}, out
                    )
                steer = (lambda: flight.setpoint(velocity=(3.0, 1.0, 0.0))) if situation == "offboard" else None
                flight.run(SPAN_S / instants, steer)
                if not flight.armed:
                    break
            os._exit(0)
        _wait(pid)


def _wait(pid: int) -> None:
    if os.waitpid(pid, 0)[1] != 0:
        os._exit(1)


def _fly(flight: Sitl, place: str, times: float, case: dict[str, Any], out: int) -> None:
    pid = os.fork()
    if pid == 0:
        verdict = ChaosFlight(flight, case["situation"], Thrower(place, times)).judged()
        facts = {**case, "place": place, "goes_on": times > 1.0, "at_s": round(flight.time_s, 3), **verdict._asdict()}
        os.write(out, (json.dumps({**facts, "bad": not verdict.holds}) + "\n").encode())
        os._exit(0)
    _wait(pid)


if __name__ == "__main__":
    sys.exit(main())
