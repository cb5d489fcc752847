"""Real-time factors of profile `flight`, and whole commands with their goals, alternating with another checkout's."""

import json
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import groupby
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any, NamedTuple, TypeAlias, TypeVar

from colibri.autopilot.control.profile import Profile
from colibri.common.process.lifecycle import EXIT_FAILED, fail
from colibri.flights.fly import fly_plan
from colibri.flights.plan import FlightPlan
from colibri.flights.spec import FlightSpec
from colibri.mavlink.hil.feedback import Feedback

CONTROLLER = "lpv-mpc"
TRACK = "lemniscate"


def with_blocks(profile: Profile, blocks: Sequence[int]) -> Profile:
    return profile.replace(f"controllers.{CONTROLLER}.plan.blocks", list(blocks))


def with_intervals(profile: Profile, *, frame_s: float, control_s: float) -> Profile:
    free = profile.replace("simulation.frame_interval_s", None)  # which must divide the control interval
    changed = free.replace(f"controllers.{CONTROLLER}.control_interval_s", control_s)
    return changed.replace("simulation.frame_interval_s", frame_s)


def plan_of(
    profile: Profile, folder: Path, duration_s: float, link: str, feedback: Feedback = Feedback.STATE
) -> FlightPlan:
    options = {"profile": profile, "link": link, "feedback": feedback, "duration": duration_s, "out": folder}
    return FlightPlan.of(FlightSpec.of(TRACK, **options))


Report: TypeAlias = Callable[[str], None]
T = TypeVar("T")
Samples: TypeAlias = dict[str, list[float]]

CONTROL_S: Mapping[int, float] = {100: 0.01, 250: 0.008, 500: 0.008}  # control interval at each frame rate, Hz
LINKS = ("memory", "udp")

_PEER_MAX_S = 2.0  # a peer may be slower than real time
_WARM_UP_S = 0.5


class PeerSimulator(NamedTuple):
    """Another simulator: from frame rate, Hz, and duration, s, to real-time factor."""

    name: str
    real_time_factor: Callable[[int, float], float]


def rate_figures(
    profile: Profile, folder: Path, duration_s: float, runs: int, report: Report, peer: PeerSimulator | None = None
) -> dict[str, Any]:
    """Fly at every rate over every link; ratios are within a run."""
    report("warm up")
    plan = plan_of(profile, folder, _WARM_UP_S, "memory")
    fly_plan(plan)
    measures: dict[str, Callable[[], float]] = {}
    for frames_hz, control_s in CONTROL_S.items():
        chosen = with_intervals(profile, frame_s=1.0 / frames_hz, control_s=control_s)
        for link in LINKS:
            plan = plan_of(chosen, folder, duration_s, link)
            measures[f"{frames_hz} Hz, {link}"] = partial(real_time_factor, plan)
        if peer is not None:
            factor = partial(peer.real_time_factor, frames_hz, min(duration_s, _PEER_MAX_S))
            measures[f"{frames_hz} Hz, {peer.name}"] = factor
    samples = sampled(runs, report, measures)
    names = (*LINKS, peer.name) if peer else LINKS
    rates = {str(hz): _with_ratios({name: samples[f"{hz} Hz, {name}"] for name in names}, peer) for hz in CONTROL_S}
    return {"track": TRACK, "control_interval_s": {str(hz): s for hz, s in CONTROL_S.items()}, "rates_hz": rates}


def sampled(runs: int, report: Report, measures: Mapping[str, Callable[[], T]]) -> dict[str, list[T]]:
    """Take measures in turn, run after run: other load weighs on all."""
    samples: dict[str, list[T]] = {name: [] for name in measures}
    for run in range(runs):
        for name, measure in measures.items():
            report(f"{name}, {run + 1} of {runs}")
            samples[name].append(measure())
    return samples


def summarised(values: Iterable[float]) -> dict[str, float]:
    ordered = sorted(values)
    return {"min": ordered[0], "median": median(ordered), "max": ordered[-1]}


def _with_ratios(flown: Samples, peer: PeerSimulator | None) -> dict[str, dict[str, float]]:
    figures = {name: summarised(values) for name, values in flown.items()}
    if peer is None:
        return figures
    for link in LINKS:
        pairs = zip(flown[link], flown[peer.name], strict=True)
        figures[f"{link} / {peer.name}"] = summarised(ours / theirs for ours, theirs in pairs)
    return figures


def real_time_factor(plan: FlightPlan) -> float:
    return plan.spec.duration / fly_plan(plan).wall_time_s


STARTS_S, THESIS_S = 0.1, 100.0
RTF, P50, P99, START = "times real time", "control step p50, µs", "control step p99, µs", "whole command, s"
_OF_REPORT: Mapping[str, Callable[[Mapping[str, Any]], float]] = {
    RTF: lambda report: report["real_time_factor"],
    P50: lambda report: report["control_step_us"]["p50"],
    P99: lambda report: report["control_step_us"]["p99"],
}


class Goal(NamedTuple):
    """A figure of a command: `RTF`, to be exceeded, or a time, to be undercut."""

    name: str
    options: tuple[str, ...]
    duration_s: float | None
    figure: str
    goal: float


GOALS = (
    Goal("spiral, UDP", ("spiral",), None, RTF, 32.0),
    Goal("lemniscate, UDP", ("lemniscate",), None, RTF, 28.0),
    Goal("spiral on sensors, UDP", ("spiral", "--feedback", "sensors"), None, RTF, 26.0),
    Goal("spiral, memory", ("spiral", "--link", "memory"), None, RTF, 38.0),
    Goal("spiral, memory", ("spiral", "--link", "memory"), None, P50, 110.0),
    Goal("spiral, memory", ("spiral", "--link", "memory"), None, P99, 220.0),
    Goal("thesis's spiral, UDP", ("spiral", "--profile", "thesis"), THESIS_S, RTF, 250.0),
    Goal("start, UDP", ("hover",), STARTS_S, START, 1.2),
    Goal("start, memory", ("hover", "--link", "memory"), STARTS_S, START, 0.7),
)


def colibri_of(checkout: Path) -> Path:
    command = checkout / ".venv" / "bin" / "colibri"
    if not command.is_file():
        fail(f"--against {checkout}: .venv/bin/colibri is missing: run make setup there")
    return command


def command_figures(duration_s: float, runs: int, report: Report, against: Path | None = None) -> dict[str, Any]:
    """Run every command in turn with that of `against`; ratios are within a run."""
    ours, theirs = [sys.executable, "-m", "colibri"], against and [str(colibri_of(against))]
    here: Samples = {}
    there: Samples = {}
    for run in range(runs):
        for name, goals in groupby(GOALS, lambda goal: goal.name):
            wanted = list(goals)
            for command, samples in ((ours, here), (theirs, there)):
                if command:
                    report(f"{name}, {run + 1} of {runs}{'' if command is ours else ', the other'}")
                    _take(command, wanted, duration_s, samples)
    return {_row(goal): _figure(goal, here[_row(goal)], there.get(_row(goal))) for goal in GOALS}


def _take(command: list[str], goals: list[Goal], duration_s: float, samples: Samples) -> None:
    _, options, own_s, *_ = goals[0]
    with TemporaryDirectory() as folder:
        flight = ["fly", *options, "--duration", str(own_s or duration_s), "--quiet", "--no-figures", "--out", folder]
        began_s = perf_counter()
        done = subprocess.run([*command, *flight], check=False)
        command_s = perf_counter() - began_s
        if done.returncode:
            fail(f"a flight ended with exit code {done.returncode}", EXIT_FAILED)
        report = json.loads((Path(folder) / "report.json").read_text(encoding="utf-8"))
    for goal in goals:
        value = command_s if goal.figure == START else _OF_REPORT[goal.figure](report)
        samples.setdefault(_row(goal), []).append(value)


def _row(goal: Goal) -> str:
    return f"{goal.name}: {goal.figure}"


def _figure(goal: Goal, ours: list[float], theirs: list[float] | None) -> dict[str, float]:
    figure = {**summarised(ours), "goal": goal.goal}
    if theirs:
        figure |= {"other": median(theirs), "ratio": median(a / b for a, b in zip(ours, theirs, strict=True))}
    return figure
