"""What the page shows of a vehicle: at an instant, around it, and over time. Plain values, SI, ENU and FLU."""

from dataclasses import dataclass, field
from math import nan
from typing import NamedTuple, Protocol

import numpy as np

from colibri.common.errors import Error
from colibri.common.types import Array, FourRotors, Quaternion, Vector

NOWHERE: Vector = (nan, nan, nan)
NO_POINTS: Array = np.empty((0, 3))
UNKNOWN_ROTORS: FourRotors = (nan, nan, nan, nan)


class ViewError(Error):
    """What cannot be shown; the message is the one line that a user needs."""


class Airframe(NamedTuple):
    """What is drawn of a vehicle that has four rotors.

    Attributes:
        rotors_m: x forward, y left of each rotor.
        spins: 1.0 of each rotor that turns counter-clockwise seen from above, -1.0 of the others.
        foot_m: How far the feet are below the rotors.
    """

    rotors_m: tuple[tuple[float, float], ...] = ((0.17, -0.17), (-0.17, 0.17), (0.17, 0.17), (-0.17, -0.17))
    spins: FourRotors = (1.0, 1.0, -1.0, -1.0)
    foot_m: float = 0.1

    @property
    def radius_m(self) -> float:
        """Radius of a rotor's disc: neighbours almost touch."""
        places = np.array(self.rotors_m)
        apart = np.linalg.norm(places[:, None] - places[None], axis=2) + np.where(np.eye(len(places)), np.inf, 0.0)
        return float(0.46 * apart.min())


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """A vehicle at an instant; nan and empty for what is not known of it.

    Attributes:
        time_s: Of the flight.
        attitude: Unit quaternion, FLU to ENU.
        rotors: Speeds as parts of the largest.
        reference_enu_m: What it steers to.
        trail: Where it was lately, ENU, m, (n, 3), the newest last.
        horizon: Where its controller predicts that it will be, ENU, m, (k, 3).
        estimate_enu_m: Where it takes itself to be, where that is not `position_enu_m`.
        sigma_m: Standard deviations of that estimate, east, north and up.
        armed: None where that is not known.
        battery: As text.
        texts: What it said last, the newest first.
    """

    time_s: float
    position_enu_m: Vector
    attitude: Quaternion
    velocity_enu_m_s: Vector = NOWHERE
    rotors: FourRotors = UNKNOWN_ROTORS
    reference_enu_m: Vector = NOWHERE
    trail: Array = field(default_factory=lambda: NO_POINTS)
    horizon: Array = field(default_factory=lambda: NO_POINTS)
    wind_enu_m_s: Vector = NOWHERE
    estimate_enu_m: Vector = NOWHERE
    sigma_m: Vector = NOWHERE
    mode: str = ""
    armed: bool | None = None
    battery: str = ""
    texts: tuple[str, ...] = ()


class Mark(NamedTuple):
    """A place with a word beside it: an item of a mission, home, a rally point."""

    place_enu_m: Vector
    text: str


class Zone(NamedTuple):
    """A part of a geofence.

    Attributes:
        corners_m: East and north of its outline, (n, 2), n >= 3.
        keeps_in: Whether the vehicle has to stay inside, and not outside.
    """

    corners_m: Array
    keeps_in: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """What stands still around a vehicle.

    Attributes:
        ground_m: Height of the ground, z of ENU.
        path: All of its flight, where that is over, ENU, m, (n, 3).
        reference_path: What it was to fly, (n, 3).
        mission: Its items that have a place, in their order.
        ceiling_m: Up to which height zones are drawn.
    """

    ground_m: float = 0.0
    path: Array = field(default_factory=lambda: NO_POINTS)
    reference_path: Array = field(default_factory=lambda: NO_POINTS)
    home_enu_m: Vector = NOWHERE
    mission: tuple[Mark, ...] = ()
    rally: tuple[Mark, ...] = ()
    fence: tuple[Zone, ...] = ()
    ceiling_m: float = 5.0


class Chart(NamedTuple):
    """Some series over the same times.

    Attributes:
        title: What is shown and its unit; charts of several flights with one title are one.
        names: Of the series; one that begins with a parenthesis is a limit, drawn grey.
        times_s: (n,).
        values: (series, n).
        headline: The one number that is shown of each flight where there are several, (n,).
    """

    title: str
    names: tuple[str, ...]
    times_s: Array
    values: Array
    headline: Array


class Source(Protocol):
    """A vehicle that can be shown, recorded or live.

    Attributes:
        name: Short, for labels.
        is_live: Whether time goes on by itself.
        span_s: From when to when it is known.
        surroundings: Another object whenever they change.
    """

    name: str
    airframe: Airframe

    @property
    def is_live(self) -> bool:
        """See above."""

    @property
    def span_s(self) -> tuple[float, float]:
        """See above."""

    @property
    def surroundings(self) -> Surroundings:
        """See above."""

    def at(self, time_s: float) -> Snapshot:
        """Return the vehicle at a time; at the nearest that is known."""

    def charts(self) -> tuple[Chart, ...]:
        """Return what is plotted of it."""
