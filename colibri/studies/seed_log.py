"""What came of each of many flights: a table that grows as they end, so that an interrupted comparison loses none."""

import csv
import re
from collections.abc import Iterable
from pathlib import Path
from typing import IO, Any, NamedTuple, Self

from colibri.analysis.estimation import MEASURED
from colibri.common.errors import Error

TABLE, SETTINGS = "seeds-flights.csv", "seeds-settings.txt"

INNOVATIONS = tuple(f"nis {kind}" for kind in MEASURED)
QUANTITIES = ("control", "true", "horizontal", "vertical", "roll", "pitch", "yaw", "nees", *INNOVATIONS)
"""Root mean squares of one flight: estimate from reference, vehicle from reference, estimate from truth (m), attitude
(degrees); the mean NEES, and the mean NIS of each kind of measurement in parts of how many numbers it has."""


class KeptError(Error):
    """What was kept cannot be gone on with; the message is the one line that a user needs."""


class Flown(NamedTuple):
    """What came of one flight.

    Attributes:
        contender: Profile, or profile:controller.
        track: What it flew.
        seed: Of everything random.
        lost: Why the vehicle was lost; empty if it was not.
        values: `QUANTITIES` after 20 s; nan where it was lost.
        innovations: How many innovations of each of `MEASURED` are in them.
        sha256: Of its trajectory.
        contents: Hash of all that it was made of, as in its provenance.
    """

    contender: str
    track: str
    seed: int
    lost: str
    values: tuple[float, ...]
    innovations: tuple[int, ...]
    sha256: str
    contents: str


_COUNTS = tuple(f"innovations {kind}" for kind in MEASURED)
COLUMNS = ("profile", "track", "seed", "lost", *QUANTITIES, *_COUNTS, "trajectory_sha256", "contents_sha256")


class FlightsLog:
    """The table, written row by row."""

    def __init__(self, folder: Path, settings: str, flown: Iterable[Flown]) -> None:
        """Begin it in `folder` with what was `flown` already, all by the same `settings`."""
        (folder / SETTINGS).write_text(settings + "\n", encoding="utf-8")
        self._file: IO[str] = (folder / TABLE).open("w", encoding="utf-8", newline="")
        self._table: Any = csv.writer(self._file, lineterminator="\n")
        self._table.writerow(COLUMNS)
        for each in flown:
            self.add(each)

    def add(self, flown: Flown) -> None:
        """Append a flight."""
        values = map(repr, map(float, flown.values))
        self._table.writerow((*flown[:4], *values, *flown.innovations, flown.sha256, flown.contents))
        self._file.flush()

    def __enter__(self) -> Self:
        """Begin."""
        return self

    def __exit__(self, *_: object) -> None:
        """End."""
        self._file.close()


def kept_flights(folder: Path, settings: str) -> dict[tuple[str, str, int], Flown]:
    """Return the flights of a table, by profile, track and seed; none where there is no table.

    Raises:
        KeptError: They were flown by other settings, or it is no such table.
    """
    try:
        were = (folder / SETTINGS).read_text(encoding="utf-8").strip()
        with (folder / TABLE).open(encoding="utf-8", newline="") as file:
            rows = [row for row in csv.reader(file) if len(row) == len(COLUMNS)]
    except FileNotFoundError:
        return {}
    except (OSError, UnicodeDecodeError) as error:
        raise KeptError(f"cannot read {folder / TABLE}: {error}") from error
    if were != settings:
        changed = _changed(were, settings)
        raise KeptError(f"--resume: {folder} has flights by other settings ({changed}): give another --out")
    try:
        return {(flown.contender, flown.track, flown.seed): flown for flown in map(_flown, rows[1:])}
    except ValueError as error:
        raise KeptError(f"{folder / TABLE}: {error}; remove it, or leave --resume out") from error


def _changed(were: str, settings: str) -> str:
    """Return those of the settings that were others."""
    old, new = (dict(one.partition("=")[::2] for one in re.split(r" (?=[a-z_]+=)", text)) for text in (were, settings))
    return ", ".join(f"{name}={old.get(name)}, now {value}" for name, value in new.items() if value != old.get(name))


def _flown(row: list[str]) -> Flown:
    contender, track, seed, lost, *numbers, sha256, contents = row
    values = tuple(map(float, numbers[: len(QUANTITIES)]))
    innovations = tuple(map(int, numbers[len(QUANTITIES) :]))
    return Flown(contender, track, int(seed), lost, values, innovations, sha256, contents)
