"""`colibri bench`: how fast the thesis's spiral flies, and how long the whole command takes."""

import argparse
import json
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import TypeAlias

from mavlink.process import EXIT_FAILED, fail

Samples: TypeAlias = dict[str, list[float]]

LINKS = ("udp", "memory")


def bench(args: argparse.Namespace) -> int:
    """Fly as often as the command line says, print minimum, median and maximum; return the exit code."""
    samples: Samples = {}
    for link in LINKS:
        for _ in range(args.runs):
            for name, value in _fly_once(link).items():
                samples.setdefault(name, []).append(value)
    figures = {name: summarised(values) for name, values in samples.items()}
    _print(figures, args.runs)
    if args.out:
        _write(figures, args.out)
    return 0


def summarised(values: Iterable[float]) -> dict[str, float]:
    """Return minimum, median and maximum."""
    ordered = sorted(values)
    return {"min": ordered[0], "median": median(ordered), "max": ordered[-1]}


def _fly_once(link: str) -> dict[str, float]:
    """Run the command as a user would, in a process of its own."""
    with TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "tools", "fly", "spiral", "--profile", "thesis", "--link", link]
        started_s = perf_counter()
        done = subprocess.run([*command, "--quiet", "--no-figures", "--out", folder], check=False)
        command_s = perf_counter() - started_s
        if done.returncode:
            fail(f"a flight ended with exit code {done.returncode}", EXIT_FAILED)
        report = json.loads((Path(folder) / "report.json").read_text(encoding="utf-8"))
    return {
        f"{link}: real-time factor": report["real_time_factor"],
        f"{link}: whole command, s": command_s,
        f"{link}: QP solve time p50, µs": report["solve_time_us"]["p50"],
        f"{link}: control step p50, µs": report["control_step_us"]["p50"],
        f"{link}: control step p99, µs": report["control_step_us"]["p99"],
    }


def _print(figures: dict[str, dict[str, float]], runs: int) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=f"spiral, profile thesis, {runs} flights a link", title_justify="left")
    table.add_column("")
    for column in ("min", "median", "max"):
        table.add_column(column, justify="right")
    for name, figure in figures.items():
        table.add_row(name, *(f"{value:.3g}" if value < 100 else f"{value:.0f}" for value in figure.values()))
    Console().print(table)


def _write(figures: dict[str, dict[str, float]], path: Path) -> None:
    try:
        path.write_text(json.dumps(figures, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    except OSError as error:
        fail(f"cannot write {path}: {error.strerror}")
