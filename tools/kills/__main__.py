"""`python -m tools.kills`: autopilots or plants killed in flight."""

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import TypeVar

from colibri.common.process.arguments import natural
from colibri.mavlink.hil.feedback import Feedback
from tools.kills.between import HangsError
from tools.kills.flights import AutopilotKill, KilledMission, PlantKill, fly_autopilots, fly_plants

MAX_TILT_DEG = 35.0 + 45.0
"""45° more than a pilot may ask for."""
MAX_LOST_M = 2.0
_PLANTS_A_FLIGHT = 10

K = TypeVar("K")


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.kills", description=__doc__)
    parser.add_argument("--of", choices=("autopilot", "plant"), default="autopilot", help="who dies")
    parser.add_argument("--kills", type=natural, default=200)
    parser.add_argument("--seed", type=natural, default=1)
    parser.add_argument("--feedback", type=Feedback, default=Feedback.STATE, metavar="state|sensors")
    args = parser.parse_args()
    started_s = perf_counter()
    run = _autopilots if args.of == "autopilot" else _plants
    lines, failures = run(args.kills, args.seed, args.feedback)
    seconds = perf_counter() - started_s
    verdict = [f"FAILED: {failure}" for failure in failures] or ["every flight went on"]
    lines.append(f"{seconds:.0f} s, {args.of}, {args.feedback}, seed {args.seed}")
    print(*lines, *verdict, sep="\n")
    return 1 if failures else 0


def failures_of(number: int, flight: KilledMission) -> list[str]:
    found = [] if flight.flown else [f"mission {number} did not end"]
    found += [f"mission {number}: {flight.words}"] if flight.words else []
    for kill in flight.kills:
        where = f"mission {number}, t = {kill.time_s:.3f} s, {kill.phase.value}, item {kill.item}"
        if kill.tilt_deg > MAX_TILT_DEG:
            found.append(f"{where}: tilted by {kill.tilt_deg:.0f} degrees")
        if kill.lost_m > MAX_LOST_M:
            found.append(f"{where}: lost {kill.lost_m:.2f} m")
        if not kill.went_on:
            found.append(f"{where}: did not say that it goes on")
    return found


def _autopilots(kills: int, seed: int, feedback: Feedback) -> tuple[list[str], list[str]]:
    def fly(folder: Path, number: int, maximum: int) -> tuple[list[AutopilotKill], list[str]]:
        flight = fly_autopilots(folder, feedback, 1000 * seed + number, maximum)
        return flight.kills, failures_of(number, flight)

    done, failures, flights = _killed("mission", kills, fly)
    hovers, others = [kill for kill in done if kill.still], [kill for kill in done if not kill.hovered]
    phases = Counter(kill.phase for kill in done)
    lines = [
        f"{len(done)} kills in {flights} missions: " + ", ".join(f"{n} {phase.value}" for phase, n in phases.items()),
        f"largest tilt after a kill {_most(kill.tilt_deg for kill in done):.1f} degrees, "
        f"and in the second before one {_most(kill.tilt_before_deg for kill in done):.1f}",
        f"hovering, {len(hovers)} kills: "
        f"largest tilt {_most(kill.tilt_deg for kill in hovers):.2f} degrees, "
        f"height lost {_most(kill.lost_m for kill in hovers):.3f} m, "
        f"moved {_most(kill.moved_m for kill in hovers):.3f} m",
        f"on the way, {len(others)} kills",
    ]
    return lines, failures


def _plants(kills: int, seed: int, feedback: Feedback) -> tuple[list[str], list[str]]:
    def fly(folder: Path, number: int, maximum: int) -> tuple[list[PlantKill], list[str]]:
        killed, words = fly_plants(folder, feedback, 1000 * seed + number, min(_PLANTS_A_FLIGHT, maximum))
        found = [f"autopilot {number}: {words}"] if words else []
        for kill in killed:
            where = f"autopilot {number}, t = {kill.time_s:.3f} s"
            if not kill.stood:
                found.append(f"{where}: the next flight did not begin anew")
            if kill.said and "waiting for a plant" not in kill.said:
                found.append(f"{where}: said {kill.said}")
        return killed, found

    done, failures, _ = _killed("autopilot", kills, fly)
    phases = Counter(kill.phase for kill in done)
    waited = sum(bool(kill.said) for kill in done)
    lines = [
        f"{len(done)} kills: " + ", ".join(f"{n} {phase.value}" for phase, n in phases.items()),
        f"{waited} times the autopilot said that it waits for a plant; every time the next plant's flight began anew",
    ]
    return lines, failures


def _killed(
    what: str, kills: int, fly: Callable[[Path, int, int], tuple[list[K], list[str]]]
) -> tuple[list[K], list[str], int]:
    done: list[K] = []
    failures: list[str] = []
    flights = 0
    while len(done) < kills:
        flights += 1
        try:
            with TemporaryDirectory() as folder:
                killed, found = fly(Path(folder) / "flight", flights, kills - len(done))
        except HangsError as error:
            failures.append(f"{what} {flights}: {error}")
            break
        done += killed
        failures += found
        print(f"{what} {flights}: {len(killed)} kills, {len(done)} in all", file=sys.stderr, flush=True)
    return done, failures, flights


def _most(values: Iterator[float]) -> float:
    return max(values, default=0.0)


if __name__ == "__main__":
    sys.exit(main())
