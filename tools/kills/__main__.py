"""`python -m tools.kills`: autopilots or plants killed in flight."""

import argparse
import random
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, sleep
from typing import NamedTuple, TypeVar

import numpy as np

from colibri.common.process.arguments import natural
from colibri.common.types import Array
from colibri.mavlink.hil.feedback import Feedback
from colibri.sitl.flight_record import tilt_deg
from tools.harness.processes import Process, topic_rows
from tools.kills.between import COMPILES_S, HOVERS, LEGS, Between, HangsError, KillInstant, KillStation, mission

_APART_S, _SPREAD_S = 1.8, 1.6
_JUDGED_S = 2.0
_SLOW_M_S = 0.3
_COMPUTES_S = 1.5e-3
STANDING = "y=0,z=0,psi=90,rotors=0"


class AutopilotKill(NamedTuple):
    time_s: float  # of the frame, simulated
    phase: KillInstant
    item: int  # of the mission, current
    hovered: bool  # at the kill
    still: bool  # in the same item at the next kill
    tilt_deg: float  # largest before the next kill
    tilt_before_deg: float  # largest in the second before
    lost_m: float  # height lost within two seconds, if still
    moved_m: float  # then, if still
    went_on: bool  # reported by the autopilot


class KilledMission(NamedTuple):
    kills: list[AutopilotKill]
    flown: bool
    words: str


@contextmanager
def _killing(
    folder: Path, station: KillStation, seed: int, out: Path | None = None
) -> Iterator[tuple[list[Process], Between, str]]:
    """Start plant and relay; yield the processes, the relay and its URL."""
    folder.mkdir()
    processes = [start_plant(folder, "udpin:127.0.0.1:0", seed, out)]
    try:
        url = processes[0].wait_for("listening")["url"]
        between = Between(url)
        yield processes, between, url
        between.close()
    finally:
        for process in processes:
            process.kill()
        station.close()


def _armed(station: KillStation) -> Callable[[], bool]:
    return lambda: station.armed is True


def fly_autopilots(folder: Path, feedback: Feedback, seed: int, max_kills: int, legs: int = LEGS) -> KilledMission:
    """Fly a mission, and kill the autopilot again and again."""
    station, chance, kills = KillStation(mission(legs)), random.Random(seed), list[_Killed]()
    with _killing(folder, station, seed, out=folder) as (processes, between, _):

        def begin() -> None:
            processes.append(start(folder, between.url, station, feedback))

        def strike(phase: KillInstant) -> None:
            if phase is KillInstant.DURING:
                sleep(chance.uniform(0.0, _COMPUTES_S))
            processes[-1].process.kill()

        def flies_on() -> bool:
            return between.time_us > died_us

        def is_said() -> bool:
            return any("Restarted in flight" in text for text in station.texts)

        begin()
        between.fly_until(station, _armed(station), "the rotors to be armed", COMPILES_S)
        died_us = between.time_us - round(_APART_S * 1e6)
        while len(kills) < max_kills:
            phase = chance.choice(list(KillInstant))
            due_us = died_us + round(1e6 * (_APART_S + chance.uniform(0.0, _SPREAD_S)))
            between.at(due_us, phase, partial(strike, phase))
            between.fly_until(station, lambda: station.flown or not between.waits, "the instant of the kill")
            if station.flown:
                break
            processes[-1].process.wait()
            died_us, item = between.time_us, station.seq
            station.texts.clear()
            between.cut()
            begin()
            between.fly_until(station, flies_on, "the flight to go on")
            between.fly_until(station, lambda: station.flown or is_said(), "the words that it goes on")
            kills.append(_Killed(died_us * 1e-6, phase, item, is_said()))
        between.fly_until(station, lambda: station.flown, "the end of the mission")
    words = "".join(process.errors() for process in processes)
    return KilledMission(judged(topic_rows(folder), kills), station.flown, words)


def start(folder: Path, url: str, station: KillStation, feedback: Feedback) -> Process:
    options = ("--plant", url, "--gcs", station.url, "--feedback", feedback, "--state", str(folder / "state"))
    return Process(folder, "autopilot", *options)


def start_plant(folder: Path, url: str, seed: int, out: Path | None = None) -> Process:
    kept = () if out is None else ("--out", str(out))
    return Process(folder, "plant", "--start", STANDING, "--seed", str(seed), "--link", url, *kept)


class _Killed(NamedTuple):
    time_s: float
    phase: KillInstant
    item: int
    went_on: bool


def judged(truth: dict[str, Array], kills: list[_Killed]) -> list[AutopilotKill]:
    t, place = truth["t"], np.stack([truth[axis] for axis in "xyz"], axis=1)
    tilt = tilt_deg(truth)
    speed = np.sqrt(truth["u"] ** 2 + truth["v"] ** 2 + truth["w"] ** 2)
    found = []
    for kill, following in zip(kills, [*kills[1:], None], strict=True):
        end_s = following.time_s if following else np.inf
        now = int(np.searchsorted(t, kill.time_s))
        after, before = (t >= kill.time_s) & (t < end_s), (t >= kill.time_s - 1.0) & (t <= kill.time_s)
        near = after & (t < kill.time_s + _JUDGED_S)
        hovered = kill.item in HOVERS and speed[now] < _SLOW_M_S
        still = bool(hovered and following is not None and following.item == kill.item)
        away = np.linalg.norm(place[near] - place[now], axis=1)
        tilts_deg = (float(tilt[after].max()), float(tilt[before].max()))
        moved_m = (float(place[now, 2] - place[near, 2].min()), float(away.max())) if still else (0.0, 0.0)
        found.append(AutopilotKill(*kill[:3], bool(hovered), still, *tilts_deg, *moved_m, kill.went_on))
    return found


_MAX_DELAY_S = 12.0


class PlantKill(NamedTuple):
    time_s: float
    phase: KillInstant
    said: str  # the autopilot's report; empty if the next plant came first
    stood: bool  # disarmed and without a mission at the next plant's start


def fly_plants(folder: Path, feedback: Feedback, seed: int, kills: int) -> tuple[list[PlantKill], str]:
    """Kill the plant again and again; start another at once, or after a report."""
    chance, station, done = random.Random(seed), KillStation(mission()), list[PlantKill]()
    with _killing(folder, station, seed) as (processes, between, url):
        autopilot = start(folder, between.url, station, feedback)
        processes.insert(0, autopilot)

        died_us = before = 0

        def silences() -> list[str]:
            return [event["text"] for event in autopilot.events("silence")]

        def is_gone() -> bool:
            return len(silences()) > before

        def begins_anew() -> bool:
            return station.armed is not None and between.time_us < died_us

        for _ in range(kills):
            plant = processes[-1]
            between.fly_until(station, _armed(station), "the rotors to be armed", COMPILES_S)
            phase = chance.choice(list(KillInstant))
            between.at(between.time_us + round(1e6 * chance.uniform(0.0, _MAX_DELAY_S)), phase, plant.process.kill)
            between.fly_until(station, lambda: not between.waits, "the instant of the kill")
            plant.process.wait()
            died_us, before = between.time_us, len(silences())
            if chance.random() < 0.5:
                between.fly_until(station, is_gone, "the words that the plant is gone")
            said = silences()[before:]
            station.begin_anew()
            processes.append(start_plant(folder, url, seed))
            between.fly_until(station, begins_anew, "the next plant's flight")
            done.append(PlantKill(died_us * 1e-6, phase, said[0] if said else "", station.armed is False))
        between.fly_until(station, _armed(station), "the last plant's vehicle to be armed")
    return done, "".join(process.errors() for process in processes)


MAX_TILT_DEG = 35.0 + 45.0  # 45° more than a pilot may ask for
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
