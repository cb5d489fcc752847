"""The folder of a flight, and a planned flight flown over whichever link."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile

from colibri.common.errors import InFlightError
from colibri.common.process.failure_file import FAILURE, keep_failure
from colibri.common.process.folder_lock import FolderInUseError, FolderLock
from colibri.common.process.lifecycle import EXIT_FAILED, fail
from colibri.flights.plan import FlightPlan, Summary, unseen
from colibri.flights.processes import FlightError, fly_processes
from colibri.flights.provenance import PROVENANCE, write_provenance

LOGS = (
    *("flight.csv", "flight.tlog", "plant.csv", "autopilot.csv", "inputs.jsonl", "estimate.csv", "filter.csv"),
    *("report.json", FAILURE, PROVENANCE),
)
FIGURES = ("trajectory.png", "position.png", "attitude.png", "inputs.png", "rotors.png", "error.png")


def fly_plan(
    plan: FlightPlan,
    progress: Callable[[float], None] = unseen,
    say: Callable[[str], None] = unseen,
    compiling: Callable[[int], None] = unseen,
) -> Summary:
    """Fly a plan over its link, and note in its folder what it is made of; return what was measured meanwhile.

    `progress` is called with the simulated time, s; `say` with a line for each ground link and each ground station that
    connects; `compiling` with the number of functions compiled so far.

    Raises:
        FlightError: It came to an early end; why is also in `FAILURE`, with the traceback where foreign code raised.
    """
    write_provenance(plan)
    if plan.link == "udp":
        return fly_processes(plan, progress, say, compiling)
    from colibri.common.jit import on_compile
    from colibri.flights.in_process import fly_locally

    on_compile(compiling)
    try:
        return fly_locally(plan, progress)
    except InFlightError as error:
        raise FlightError(keep_failure(error, plan.out), EXIT_FAILED, said=False) from error


def prepare(out: Path) -> None:
    """Make the folder of a flight, and leave nothing of an earlier one in it."""
    make_folder(out)
    try:
        for name in (*LOGS, *FIGURES):
            (out / name).unlink(missing_ok=True)
    except OSError as error:
        fail(f"cannot write to --out {out}: {error.strerror}")


@contextmanager
def occupied(out: Path) -> Iterator[None]:
    """Keep other commands from writing to a folder meanwhile, or end with one line where one of them does."""
    make_folder(out)
    try:
        lock = FolderLock(out, "--out")
    except FolderInUseError as error:
        fail(str(error))
    with lock:
        yield


def make_folder(out: Path) -> None:
    """Make a folder that can be written to, or end with one line."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=out):
            pass
    except OSError as error:
        fail(f"cannot write to --out {out}: {error.strerror}")
