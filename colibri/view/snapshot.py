"""The state that the page shows. SI, ENU and FLU."""

from dataclasses import dataclass, field
from math import nan
from typing import NamedTuple, Protocol

import numpy as np

from colibri.common.errors import Error
from colibri.common.types import Array, PerRotor, Quaternion, Vector

NOWHERE: Vector = (nan, nan, nan)
NO_POINTS: Array = np.empty((0, 3))
UNKNOWN_ROTORS: PerRotor = (nan, nan, nan, nan)


class ViewError(Error):
    """Data that cannot be shown."""


class VehicleShape(NamedTuple):
    """The geometry of a vehicle; `rotors_m` are x forward and y left of each rotor."""

    rotors_m: tuple[tuple[float, float], ...] = ((0.17, -0.17), (-0.17, 0.17), (0.17, 0.17), (-0.17, -0.17))
    spins: PerRotor = (1.0, 1.0, -1.0, -1.0)  # 1.0 counter-clockwise from above, -1.0 clockwise
    foot_m: float = 0.1  # height of the rotors above the feet

    @classmethod
    def of(cls, rotors: int) -> "VehicleShape":
        """Return four rotors (0: unknown), or others in a circle."""
        if rotors in (0, len(cls().rotors_m)):
            return cls()
        angles = 2.0 * np.pi * (0.5 - np.arange(rotors)) / rotors
        places = 0.24 * max(rotors / 4.0, 1.0) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        return cls(tuple((x, y) for x, y in places.tolist()), tuple((-1.0) ** rotor for rotor in range(rotors)))

    @property
    def radius_m(self) -> float:
        """Radius of a rotor's disc: neighbours almost touch."""
        places = np.array(self.rotors_m)
        apart = np.linalg.norm(places[:, None] - places[None], axis=2)
        return float(0.46 * apart[apart > 0.1 * apart.max()].min())


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """A vehicle at an instant; unknown values are nan or empty."""

    time_s: float
    position_enu_m: Vector
    attitude: Quaternion  # unit quaternion, FLU to ENU
    velocity_enu_m_s: Vector = NOWHERE
    rotors: PerRotor = UNKNOWN_ROTORS  # fractions of the largest speed
    reference_enu_m: Vector = NOWHERE
    trail: Array = field(default_factory=lambda: NO_POINTS)  # recent positions, (n, 3), the newest last
    horizon: Array = field(default_factory=lambda: NO_POINTS)  # predicted positions, (k, 3)
    wind_enu_m_s: Vector = NOWHERE
    estimate_enu_m: Vector = NOWHERE  # estimated position, if `position_enu_m` is the true one
    sigma_m: Vector = NOWHERE  # its standard deviations, east, north, up
    mode: str = ""
    armed: bool | None = None
    battery: str = ""
    texts: tuple[str, ...] = ()


class Mark(NamedTuple):
    """A labelled place: mission item, home or rally point."""

    place_enu_m: Vector
    text: str


class Zone(NamedTuple):
    """A part of a geofence; its outline is east and north, (n, 2)."""

    corners_m: Array
    keeps_in: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """The static objects around a vehicle; paths are (n, 3)."""

    ground_m: float = 0.0
    path: Array = field(default_factory=lambda: NO_POINTS)
    reference_path: Array = field(default_factory=lambda: NO_POINTS)
    home_enu_m: Vector = NOWHERE
    mission: tuple[Mark, ...] = ()
    rally: tuple[Mark, ...] = ()
    fence: tuple[Zone, ...] = ()
    ceiling_m: float = 5.0


class Chart(NamedTuple):
    """Some series over the same times."""

    title: str  # quantity and unit; charts of several flights are merged by it
    names: tuple[str, ...]  # of the series; a limit is in parentheses
    times_s: Array
    values: Array  # (series, n)
    headline: Array  # what to show of each of several flights, (n,)


class Source(Protocol):
    """A vehicle, recorded or live; `surroundings` is a new object after each change."""

    name: str

    @property
    def airframe(self) -> VehicleShape: ...

    @property
    def is_live(self) -> bool: ...

    @property
    def span_s(self) -> tuple[float, float]: ...

    @property
    def surroundings(self) -> Surroundings: ...

    def at(self, time_s: float) -> Snapshot:
        """Return the vehicle at the nearest known time."""

    def charts(self) -> tuple[Chart, ...]: ...
