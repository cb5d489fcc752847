"""Several vehicles at once, each with a plant, an autopilot and ground stations of its own, in one simulated time."""

from collections.abc import Iterable, Sequence
from typing import Any

from colibri.sitl.backends.setting import SettingError, setting_of
from colibri.sitl.session import Flights
from colibri.sitl.stepping import Stepped
from colibri.sitl.vehicle import Sitl


class Fleet(tuple[Sitl, ...], Stepped):
    """Vehicles that share one simulated time: none is ever more than a frame ahead.

    Whichever of them is flown, by `run`, `step` or an order that waits, all fly as long; so they do by the fleet's own
    `run`, `wait_until` and `hold`.
    """

    __slots__ = ()

    def __new__(cls, vehicles: Iterable[Sitl] = ()) -> "Fleet":
        """Bind the time of `vehicles` together; those that are behind fly until they have caught up."""
        fleet = super().__new__(cls, vehicles)
        for sitl in fleet:
            sitl.fleet = fleet
        if fleet:
            max(fleet, key=lambda sitl: sitl.time_us).have_others_catch_up()
        return fleet

    @property
    def time_us(self) -> int:
        """Simulated time of the vehicle that is behind, µs; others differ only where frames are of unequal length."""
        return min(sitl.time_us for sitl in self)

    def step(self) -> None:
        """Fly one frame."""
        min(self, key=lambda sitl: sitl.time_us).step()

    def __str__(self) -> str:
        """Return the state of each vehicle, for the message of a failed test."""
        return "; ".join(f"vehicle {sitl.system}: {sitl}" for sitl in self)


def begin_fleet(
    flights: Flights,
    count: int,
    *,
    spacing: float = 0.0,
    places: Sequence[tuple[float, float]] | None = None,
    **changes: Any,
) -> Fleet:
    """Begin the flights of a fleet.

    Args:
        flights: Of the test.
        count: How many vehicles.
        spacing: How far each stands east of the one before, m.
        places: In its stead: where each stands, east and north of where a vehicle stands by itself, m.
        changes: Of the test's setting, for all of them.

    Raises:
        SettingError: They cannot begin so.
    """
    if count < 1:
        raise SettingError(f"a fleet has at least one vehicle, not {count}")
    if places is None:
        places = [(number * spacing, 0.0) for number in range(count)]
    if len(places) != count:
        raise SettingError(f"places: expected one for each of {count} vehicles, found {len(places)}")
    begun = len(flights.flown)
    start = setting_of([{"start": changes.pop("start", flights.setting.start)}]).start
    return Fleet(
        flights.begin(
            **{
                "system": begun + number + 1,
                "start": {**start, "x": start.get("x", 0.0) + east, "y": start.get("y", 0.0) + north},
                **changes,
            }
        )
        for number, (east, north) in enumerate(places)
    )
