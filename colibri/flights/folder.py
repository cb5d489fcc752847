"""The folder of a flight: its files and its lock."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile

from colibri.common.process.failure_file import FAILURE
from colibri.common.process.folder_lock import FolderInUseError, FolderLock
from colibri.common.process.lifecycle import fail

PROVENANCE = "provenance.json"
LOGS = ("flight.ulg", "flight.csv", "flight.tlog", "report.json", FAILURE, PROVENANCE)
FIGURES = ("trajectory.png", "position.png", "attitude.png", "inputs.png", "rotors.png", "error.png")


def prepare(out: Path) -> None:
    """Make the folder of a flight, without files of an earlier one."""
    make_folder(out, without=(*LOGS, *FIGURES))


@contextmanager
def occupied(out: Path) -> Iterator[None]:
    """Lock a folder against other commands."""
    make_folder(out)
    try:
        lock = FolderLock(out, "--out")
    except FolderInUseError as error:
        fail(str(error))
    with lock:
        yield


def make_folder(out: Path, *, without: Iterable[str] = ()) -> None:
    try:
        out.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=out):
            pass
        for name in without:
            (out / name).unlink(missing_ok=True)
    except OSError as error:
        fail(f"cannot write to --out {out}: {error.strerror}")
