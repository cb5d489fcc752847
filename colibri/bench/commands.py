"""Whole commands with their goals, alternating with another checkout's."""

import json
import subprocess
import sys
from collections.abc import Callable, Mapping
from itertools import groupby
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any, NamedTuple

from colibri.bench.speed import Report, Samples, summarised
from colibri.common.process.lifecycle import EXIT_FAILED, fail

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
COMMANDS = len({goal.name for goal in GOALS})


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
