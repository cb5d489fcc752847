"""What is flown: tracks, vehicles and disturbances of each set, and published values."""

from collections.abc import Iterator, Mapping
from math import inf
from typing import Any, NamedTuple

import numpy as np

from colibri.autopilot.guidance.trajectories.reach import exact_motion
from colibri.autopilot.guidance.trajectories.registry import track
from colibri.autopilot.guidance.trajectories.tracks import position
from colibri.common.elementary import square
from colibri.plant.vehicle.description import Vehicle, load_vehicle

_OFFSETS_MM = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, 0, 0), (0, -1, 0), (0, 0, -1))
MAX_STARTS = len(_OFFSETS_MM)


class Row(NamedTuple):
    """A row of the table: a track, by its name and top speed, m/s (0: its only one), under a disturbance."""

    track: str
    speed: float
    world: str

    def __str__(self) -> str:
        return f"{self.track} {self.speed:g}, {self.world}"


class Published(NamedTuple):
    """Values of a publication: mean position errors, mm, by track, along the speeds."""

    law: str
    source: str
    world: str
    mean_mm: Mapping[str, tuple[float, ...]]


class ArenaSet(NamedTuple):
    """A set of flights that all laws fly.

    Attributes:
        tracks: Its flights, as options of a track, by name; `{speed}` is replaced.
        speeds: Top speeds of each track, m/s; empty if the track has one speed.
        worlds: Disturbances by name, each as settings of a campaign.
        duration_s: Longest flight.
    """

    does: str
    vehicle: Vehicle
    tracks: Mapping[str, str]
    speeds: Mapping[str, tuple[float, ...]]
    worlds: Mapping[str, Mapping[str, Any]]
    duration_s: float = inf
    published: tuple[Published, ...] = ()

    def rows(self) -> Iterator[Row]:
        for name in self.tracks:
            for speed in self.speeds.get(name, (0.0,)):
                yield from (Row(name, speed, world) for world in self.worlds)

    def flown(self, row: Row) -> str:
        return self.tracks[row.track].format(speed=row.speed)

    def settings(self, row: Row, start: int) -> dict[str, Any]:
        """Return the settings of a flight that starts at rest in hover, by `start` a millimetre beside its track."""
        flown, world = track(self.flown(row)), self.worlds[row.world]
        plant = world.get("plant_vehicle", self.vehicle)
        x, y, z = (position(flown, np.zeros(1))[0] + 1e-3 * np.array(_OFFSETS_MM[start])).tolist()
        begin = {"x": x, "y": y, "z": z, "psi": 0.0, "rotors": plant.hover_rpm}
        duration_s = min(flown.duration_s, self.duration_s)
        usual = {"vehicle": self.vehicle, "plant_vehicle": self.vehicle}
        return usual | {"track": self.flown(row), "duration": duration_s, "start": begin} | dict(world)

    def thrust(self, row: Row) -> float:
        """Return the largest thrust that a track needs, without drag, in parts of what the rotors have."""
        vehicle = self.worlds[row.world].get("plant_vehicle", self.vehicle)
        acceleration = exact_motion(track(self.flown(row))).acceleration
        needed = np.linalg.norm(acceleration + np.array([0.0, 0.0, vehicle.gravity_m_s2]), axis=1)
        return float(vehicle.body.mass_kg * needed.max() / vehicle.max_wrench()[0])


def _rotors_hummingbird(*, told: bool) -> Vehicle:
    """Return RotorS' Hummingbird, as its plant has it, or as SSI-MPC's laws assume it.

    They leave out drag and the rotors' own inertia, and take 9.81 m/s² for 9.8066.
    """
    thrust, arm, rotor_kg, blade_kg = 8.54858e-6, 0.17, 0.009, 0.09
    blade = blade_kg / 12.0 * (square(0.1) + square(0.015))
    across, about = (rotors * rotor_kg * square(arm) for rotors in (2.0, 4.0))
    inertia = (0.007 + across, 0.007 + across, 0.012 + about + 4.0 * blade) if told else (0.007, 0.007, 0.012)
    vehicle = load_vehicle("hummingbird").without(("battery", "ground"))
    for key, value in (
        ("body.mass_kg", 0.68 + 4.0 * rotor_kg),
        ("body.inertia_kg_m2", inertia),
        ("gravity_m_s2", 9.8066 if told else 9.81),
        ("rotors.thrust_coefficient", thrust),
        ("rotors.torque_coefficient", 0.05 * thrust),
        ("rotors.position_m", ((arm, 0.0), (0.0, -arm), (-arm, 0.0), (0.0, arm))),
        ("drag.linear_n_s_m", (0.0, 0.0, 0.0)),
    ):
        vehicle = vehicle.replace(key, value)
    return vehicle if told else vehicle.without(("drag",))


_RACE = ("circle", "tilted-circle", "lemniscate", "wrapped-circle", "wrapped-lemniscate")
_SSI_MPC = "arXiv 2407.04143, July 2024, mean of 5 runs in Gazebo"
_ADAPTIVE_MM = (
    (3.3, 9.0, 19.9, 27.8, 61.0),
    (3.1, 8.4, 19.4, 29.5, 63.0),
    (6.1, 14.3, 29.5, 56.0, 165.0),
    (3.6, 11.6, 23.7, 41.0, 214.0),
    (6.6, 17.5, 35.6, 62.5, 154.0),
)
_NOMINAL_MM = (
    (64.0, 124.0, 174.0, 219.0, 261.0),
    (64.0, 124.0, 175.0, 218.0, 262.0),
    (59.0, 117.0, 159.0, 196.0, 295.0),
    (63.0, 120.0, 170.0, 216.0, 331.0),
    (52.0, 100.0, 146.0, 193.0, 299.0),
)


def _race() -> ArenaSet:
    plant = _rotors_hummingbird(told=True)
    return ArenaSet(
        "SSI-MPC's 25 cells on RotorS' Hummingbird, the laws not told, and told, its drag, inertia and gravity",
        plant,
        {name: f"ramped:curve={name},speed={{speed}}" for name in _RACE},
        {name: (2.5, 5.0, 7.5, 10.0, 12.5) for name in _RACE[:-1]} | {_RACE[-1]: (2.0, 4.0, 6.0, 8.0, 10.0)},
        {"not told": {"vehicle": _rotors_hummingbird(told=False)}, "told": {}},
        published=(
            Published("SSI-MPC + INDI", _SSI_MPC, "not told", dict(zip(_RACE, _ADAPTIVE_MM, strict=True))),
            Published("nominal NMPC", _SSI_MPC, "not told", dict(zip(_RACE, _NOMINAL_MM, strict=True))),
        ),
    )


_UNKNOWN: dict[str, dict[str, Any]] = {
    "nominal": {},
    "mass +20 %": {"plant-vehicle.body.mass_kg*": 1.2},
    "inertia +30 %": {"plant-vehicle.body.inertia_kg_m2*": 1.3},
    "a rotor 10 % weaker": {"plant-vehicle.rotors.strength.0*": 0.9},
}


def _robust() -> ArenaSet:
    slow = {f"plant-vehicle.rotors.lag.time_constant_{way}_s*": 1.5 for way in ("up", "down")}
    tracks = {name: f"ramped:curve={name},acceleration=1,speed={{speed}}" for name in ("circle", "wrapped-lemniscate")}
    return ArenaSet(
        "disturbances that no law is told of, on a racer with slow rotors for its agility",
        load_vehicle("kingfisher").without(("battery", "ground")),
        tracks,
        {"circle": (7.5,), "wrapped-lemniscate": (4.0,)},
        _UNKNOWN | {"rotor lag +50 %": slow, "wind 8 m/s, light turbulence": {"wind": "8@270", "turbulence": "light"}},
    )


def _policy() -> ArenaSet:
    tracks = {"hover": "hover", "spiral": "spiral"}
    tracks |= {f"lemniscate of {lap} s": f"lemniscate:lap={lap},yaw=fixed" for lap in (12, 6)}
    return ArenaSet(
        "slow and fast tracks with unknown mass, inertia and rotors, for learned policies beside laws",
        load_vehicle("hummingbird").without(("battery", "ground")),
        tracks,
        {},
        _UNKNOWN,
        duration_s=30.0,
    )


SETS = {"race": _race, "policy": _policy}
