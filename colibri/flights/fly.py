"""The folder of a flight, and a planned flight flown over whichever link."""

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryFile

from colibri.common.process.lifecycle import fail
from colibri.flights.plan import FlightPlan, Summary, unseen
from colibri.flights.processes import fly_processes

LOGS = (
    *("flight.csv", "flight.tlog", "plant.csv", "autopilot.csv", "inputs.jsonl", "estimate.csv", "filter.csv"),
    "report.json",
)
FIGURES = ("trajectory.png", "position.png", "attitude.png", "inputs.png", "rotors.png", "error.png")


def fly_plan(
    plan: FlightPlan, progress: Callable[[float], None] = unseen, say: Callable[[str], None] = unseen
) -> Summary:
    """Fly a plan over its link; return what was measured meanwhile.

    `progress` is called with the simulated time, s; `say` with a line for each ground link and each ground station that
    connects.
    """
    if plan.link == "udp":
        return fly_processes(plan, progress, say)
    from colibri.flights.in_process import fly_locally

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
