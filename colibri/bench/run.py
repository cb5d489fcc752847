"""`colibri bench`: time of each stage, and real-time factors."""

import argparse
import json
import os
import platform
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from colibri.analysis.tables import Row, print_table
from colibri.autopilot.control.profile import load_profile
from colibri.bench.costs import sensing_figures, serving_figures, simulator_figures
from colibri.bench.speed import PeerSimulator, Report, colibri_of, command_figures, rate_figures
from colibri.bench.stages import stage_figures
from colibri.common.files import regular
from colibri.common.process.lifecycle import EXIT_FAILED, fail, one_line

PROFILE = "flight"
MIN_DURATION_S, MAX_DURATION_S = 0.1, 1000.0
Table: TypeAlias = tuple[str, Row, list[Row]]
"""Title, headings and rows."""
_SPREAD, _QUANTILES = ("min", "median", "max"), ("p50", "p99")


def bench(args: argparse.Namespace, peer: PeerSimulator | None = None) -> int:
    wanted = args.only or ["stages", "flights", "sensors", "simulators", "ground", "commands"]
    if not MIN_DURATION_S <= args.duration <= MAX_DURATION_S:
        fail(f"--duration: {MIN_DURATION_S:g} to {MAX_DURATION_S:g} s, not {args.duration:g}")
    if args.out:
        _write(args.out)
    if args.against:
        colibri_of(args.against)
    figures: dict[str, Any] = {"settings": _settings(args)}
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with (
        one_line(EXIT_FAILED),
        Progress(*columns, console=console, disable=not console.is_terminal) as bar,
        TemporaryDirectory() as folder,
    ):
        task = bar.add_task("", total=len(wanted))
        report: Report = lambda what: bar.update(task, description=what)  # noqa: E731
        flown = (load_profile(PROFILE), Path(folder), args.duration)
        measures: dict[str, Callable[[], dict[str, Any]]] = {
            "stages": lambda: stage_figures(*flown, report),
            "flights": lambda: rate_figures(*flown, args.runs, report, peer),
            "sensors": lambda: sensing_figures(*flown, args.runs, report),
            "simulators": lambda: simulator_figures(args.duration, report),
            "ground": lambda: serving_figures(*flown, args.runs, report),
            "commands": lambda: command_figures(args.duration, args.runs, report, args.against),
        }
        for name in (name for name in measures if name in wanted):
            figures[name] = measures[name]()
            bar.advance(task)
    if args.out:
        _write(args.out, json.dumps(figures, indent=2, ensure_ascii=False) + "\n")
    for table in _tables(figures):
        print_table(*table, names=1)
    return 0


def _settings(args: argparse.Namespace) -> dict[str, Any]:
    machine = {"python": platform.python_version(), "machine": platform.machine(), "cpus": os.cpu_count()}
    return {"profile": PROFILE, "runs": args.runs, "duration_s": args.duration, **machine}


def _tables(figures: Mapping[str, Any]) -> Iterator[Table]:
    runs = f"{figures['settings']['runs']} runs"
    if stages := figures.get("stages"):
        horizons = {horizon: measured["us"] for horizon, measured in stages["horizons"].items()}
        yield _by_horizon(f"{stages['track']}, profile {PROFILE}: stages of a control step, p50 / p99 µs", horizons)
        yield _by_horizon("QP by solver, p50 / p99 µs, part solved", stages["solvers"])
        yield _columns("link, µs", stages["link"], _QUANTILES)
    if flights := figures.get("flights"):
        rates = flights["rates_hz"].items()
        rows = {f"{frames_hz} Hz: {name}": figure for frames_hz, rate in rates for name, figure in rate.items()}
        title = f"{flights['track']}, profile {PROFILE}, times real time (min, median, max), {runs}"
        yield _columns(title, rows, _SPREAD)
    if sensors := figures.get("sensors"):
        yield _columns("step of the estimator, µs", sensors["estimator_us"], _QUANTILES)
        title = f"{sensors['track']}, profile {PROFILE}, frames at 250 Hz, times real time, {runs}"
        yield _columns(title, sensors["real_time_factor"], _SPREAD)
    if simulators := figures.get("simulators"):
        title = "the plant as a simulator, from an autopilot's command to the next frame, µs"
        yield _columns(title, simulators["exchange_us"], _QUANTILES)
    if ground := figures.get("ground"):
        title = f"{ground['track']}, profile {PROFILE}: to serve ground stations after a frame"
        rows = {f"{channels} connected": figure for channels, figure in ground["serve"].items()}
        yield _columns(title, rows, ("p50", "p99", "messages_hz"), ("p50 µs", "p99 µs", "messages a second"))
        yield _columns("control step at real time, µs", ground["control_step_us"], _QUANTILES)
    if commands := figures.get("commands"):
        others = ("other", "ratio") if "ratio" in next(iter(commands.values())) else ()
        yield _columns(f"whole commands, {runs}", commands, (*_SPREAD, "goal", *others))


def _by_horizon(title: str, figures: Mapping[str, Mapping[str, Mapping[str, float]]]) -> Table:
    names = next(iter(figures.values()))
    rows = [(name, *(_of_stage(measured[name]) for measured in figures.values())) for name in names]
    return title, ("", *(f"N = {horizon}" for horizon in figures)), rows


def _of_stage(figure: Mapping[str, float]) -> str:
    times = f"{_number(figure['p50'])} / {_number(figure['p99'])}"
    return times if figure.get("solved", 1.0) == 1.0 else f"{times}, {100.0 * figure['solved']:.0f} %"


def _columns(
    title: str, rows: Mapping[str, Mapping[str, float]], names: Sequence[str], headings: Sequence[str] = ()
) -> Table:
    cells = [(row, *(_number(figure[name]) for name in names)) for row, figure in rows.items()]
    return title, ("", *(headings or names)), cells


def _number(value: float) -> str:
    return f"{value:.3g}" if value < 100 else f"{value:.0f}"


def _write(path: Path, text: str = "") -> None:
    """Write a text; without one only check for permission."""
    try:
        with open(path, "w" if text else "a", encoding="utf-8", opener=regular) as file:
            file.write(text)
    except OSError as error:
        fail(f"cannot write {path}: {error.strerror}")
