"""`colibri fly`: fly one track, show how far it is, report how well it went."""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile

from autopilot.controller import ControllerError, DecisionError
from autopilot.profile import ProfileError
from autopilot.qp import SolverError
from autopilot.tracks import TrackError
from mavlink.process import EXIT_FAILED, EXIT_INTERRUPTED, fail
from plant.scenario import IntegrationError
from plant.vehicle import VehicleError
from tools.plan import FlightPlan, PlanError
from tools.processes import FlightError, fly_processes
from tools.recording import Recording, RecordingError, Summary, read_recording, write_recording
from tools.report import Report, print_report, report, write_report

LOGS = (
    *("flight.csv", "flight.tlog", "plant.csv", "autopilot.csv", "inputs.jsonl", "estimate.csv", "filter.csv"),
    "report.json",
)
_UPDATES = 500
FIGURES = ("trajectory.png", "position.png", "attitude.png", "inputs.png", "rotors.png", "error.png")


def fly(args: argparse.Namespace) -> int:
    """Fly as the command line says; return the exit code."""
    try:
        plan = FlightPlan.from_arguments(args)
    except (PlanError, ProfileError, VehicleError, TrackError) as error:
        fail(str(error))
    prepare(plan.out)
    try:
        with _progress(plan, quiet=args.quiet) as (progress, say):
            summary = _flight(plan, progress, say)
    except (ControllerError, ProfileError, SolverError) as error:
        fail(str(error))
    except (IntegrationError, DecisionError) as error:
        _keep(plan)
        fail(f"{error}; what was logged is in {plan.out}", EXIT_FAILED)
    except FlightError as error:
        _keep(plan)
        if error.said:
            return error.code
        fail(f"{error}; what was logged is in {plan.out}", error.code)
    except KeyboardInterrupt:
        _keep(plan)
        fail(f"interrupted; what was logged is in {plan.out}", EXIT_INTERRUPTED)
    recording, figures = keep_flight(plan, summary)
    if not args.no_figures:
        from tools.figures import draw_flight

        draw_flight(recording, plan)
    if not args.quiet:
        print_report(figures, plan.out)
    return 0


def keep_flight(plan: FlightPlan, summary: Summary) -> tuple[Recording, Report]:
    """Write `flight.csv` and `report.json` of a flight that ended well; return both."""
    recording = read_recording(plan)
    figures = report(plan, summary, recording)
    write_recording(recording, plan.out / "flight.csv")
    write_report(figures, plan.out / "report.json")
    return recording, figures


def _flight(plan: FlightPlan, progress: Callable[[float], None], say: Callable[[str], None]) -> Summary:
    if plan.link == "udp":
        return fly_processes(plan, progress, say)
    from tools.local import fly_locally

    return fly_locally(plan, progress)


def prepare(out: Path) -> None:
    """Make the folder of a flight, and leave nothing of an earlier one in it."""
    make_folder(out)
    try:
        for name in (*LOGS, *FIGURES):
            (out / name).unlink(missing_ok=True)
    except OSError as error:
        fail(f"cannot write to --out {out}: {error.strerror}")


def make_folder(out: Path) -> None:
    """Make a folder that can be written to, or end with one line."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=out):
            pass
    except OSError as error:
        fail(f"cannot write to --out {out}: {error.strerror}")


def _keep(plan: FlightPlan) -> Recording | None:
    """Write what there is of a flight that did not end well."""
    try:
        recording = read_recording(plan)
    except (RecordingError, OSError):
        return None
    write_recording(recording, plan.out / "flight.csv")
    return recording


@contextmanager
def _progress(plan: FlightPlan, *, quiet: bool) -> Iterator[tuple[Callable[[float], None], Callable[[str], None]]]:
    """Show on standard error a bar with simulated time and speed, and above it what there is to say."""
    if quiet:
        yield lambda _sim_time_s: None, lambda _text: None
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:6.1f} / {task.total:.1f} s"),
        TextColumn("{task.fields[speed]}"),
        TimeElapsedColumn(),
    )
    console = Console(stderr=True, highlight=False, soft_wrap=True)
    bar = Progress(*columns, console=console, disable=not console.is_terminal)
    task = bar.add_task(escape(plan.track_name), total=plan.duration_s, speed="", start=False)
    first_s: list[float] = []
    due_s = 0.0

    def show(sim_time_s: float) -> None:
        nonlocal due_s
        if sim_time_s < due_s:
            return
        due_s = sim_time_s + plan.duration_s / _UPDATES
        if not first_s:
            bar.start()  # not before something flies: an error of the start stands alone
            bar.start_task(task)
            first_s.append(sim_time_s)
        elapsed_s = bar.tasks[task].elapsed or 0.0
        speed = f"{(sim_time_s - first_s[0]) / elapsed_s:.0f} × real time" if elapsed_s else ""
        bar.update(task, completed=sim_time_s, speed=speed)

    try:
        yield show, lambda text: console.print(text, markup=False)
        bar.update(task, completed=plan.duration_s)
    finally:
        bar.stop()
