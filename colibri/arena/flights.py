"""The flights of an arena: sets as TOML files."""

from collections.abc import Iterator
from math import inf, isfinite
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from colibri.autopilot.guidance.trajectories.loading import file_of, with_file
from colibri.autopilot.guidance.trajectories.registry import track
from colibri.autopilot.guidance.trajectories.tracks import DURATION_S, Track, position
from colibri.campaigns.factors import CampaignError
from colibri.common.config import Positive, Table, read_named
from colibri.common.errors import unknown
from colibri.plant.spec import Part
from colibri.plant.vehicle.description import Vehicle, load_vehicle

_FOLDER = Path(__file__).parent / "sets"
_OFFSETS_MM = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, 0, 0), (0, -1, 0), (0, 0, -1))
MAX_STARTS = len(_OFFSETS_MM)
_INTERVAL_S = 0.02


class Row(NamedTuple):
    """A track at a top speed (0: its only one), under a disturbance."""

    track: str
    speed_m_s: float
    world: str

    def __str__(self) -> str:
        return f"{self.track} {self.speed_m_s:g}, {self.world}"


class Published(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Values of a publication: mean position errors, mm, by track, along its speeds."""

    law: str
    source: str
    world: str
    mean_mm: dict[str, tuple[Positive, ...]]


class ArenaSet(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The file of a set."""

    vehicle: str  # of laws and plant, without the parts `without`; a file may lie beside that of the set
    tracks: dict[str, str]  # tracks by name; `{speed}` is replaced
    worlds: dict[str, dict[str, Any]]  # disturbances by name, each as factors of a campaign
    without: tuple[Part, ...] = ()
    speeds: dict[str, tuple[Positive, ...]] = msgspec.field(default_factory=dict)  # top speeds of tracks, m/s
    duration_s: float = inf  # of the longest flight; by default tracks without an end last 100 s
    published: tuple[Published, ...] = ()

    def __post_init__(self) -> None:
        for name in self.speeds:
            if name not in self.tracks:
                raise ValueError(f"speeds: {unknown('track', name, self.tracks)}")
        for name, text in self.tracks.items():
            if ("{speed}" in text) is not bool(self.speeds.get(name)):
                raise ValueError(f"tracks.{name}: needs both {{speed}} and speeds.{name}, or neither")
        for each in self.published:
            for name, values in each.mean_mm.items():
                if each.world not in self.worlds or len(values) != len(self.speeds.get(name, ())):
                    raise ValueError(f"published: {each.law}: {name} needs a value for each of its speeds, and a world")

    def rows(self) -> Iterator[Row]:
        for name in self.tracks:
            for speed in self.speeds.get(name, (0.0,)):
                yield from (Row(name, speed, world) for world in self.worlds)


class Arena:
    def __init__(self, given: str) -> None:
        """`given`: the name of a set, or a path that ends in `.toml`; CampaignError if it cannot be read."""
        self.set = read_named("set", _FOLDER, given, ArenaSet, CampaignError)
        self._folder = Path(given).parent if given.endswith(".toml") else _FOLDER
        self._vehicles: dict[str, Vehicle] = {}

    def vehicle(self, row: Row | None = None, key: str = "vehicle") -> Vehicle:
        """Return the vehicle of the laws, or with key `plant_vehicle` of the plant."""
        return self._loaded(str(self.set.worlds[row.world].get(key, self.set.vehicle) if row else self.set.vehicle))

    def _loaded(self, given: str) -> Vehicle:
        if given not in self._vehicles:
            beside = self._folder / given
            loaded = load_vehicle(str(beside) if beside.is_file() else given)
            self._vehicles[given] = loaded.without(self.set.without)
        return self._vehicles[given]

    def settings(self, row: Row, start: int) -> dict[str, Any]:
        """Return the factors of a flight from hover, by `start` a millimetre beside its track."""
        vehicles = {key: self.vehicle(row, key) for key in ("vehicle", "plant_vehicle")}
        text, flown = self._track(row)
        x, y, z = (position(flown, np.zeros(1))[0] + 1e-3 * np.array(_OFFSETS_MM[start])).tolist()
        begin = {"x": x, "y": y, "z": z, "psi": 0.0, "rotors": vehicles["plant_vehicle"].hover_rpm}
        found = {"track": text, "duration": self._duration_s(flown), "start": begin} | self.set.worlds[row.world]
        return found | (
            vehicles if vehicles["vehicle"] != vehicles["plant_vehicle"] else {"vehicle": vehicles["vehicle"]}
        )

    def thrust(self, row: Row) -> float:
        """Return the largest thrust that a track needs, without drag, in parts of what the rotors have."""
        vehicle = self.vehicle(row, "plant_vehicle")
        flown = self._track(row)[1]
        if flown.waypoints is not None and flown.waypoints.fastest:
            return 1.0 - flown.waypoints.margin
        times_s = np.arange(0.0, self._duration_s(flown), _INTERVAL_S)
        needed = position(flown, times_s, 2) + np.array([0.0, 0.0, vehicle.gravity_m_s2])
        return float(vehicle.body.mass_kg * np.linalg.norm(needed, axis=1).max() / vehicle.max_wrench()[0])

    def is_planned(self, row: Row) -> bool:
        """Return whether each law plans the track itself, within its limits."""
        waypoints = self._track(row)[1].waypoints
        return waypoints is not None and waypoints.fastest

    def _duration_s(self, flown: Track) -> float:
        lasts_s = min(flown.duration_s, self.set.duration_s)
        return lasts_s if isfinite(lasts_s) else DURATION_S

    def _track(self, row: Row) -> tuple[str, Track]:
        text = self.set.tracks[row.track].replace("{speed}", repr(row.speed_m_s))
        beside = self._folder / (file_of(text) or "")
        if beside.is_file():
            text = with_file(text, beside)
        return text, track(text)
