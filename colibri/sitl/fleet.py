"""Several vehicles in one simulated time."""

from collections.abc import Iterable, Sequence
from typing import Any

from colibri.sitl.backends.setting import SettingError, setting_of
from colibri.sitl.session import Flights
from colibri.sitl.stepping import Stepped
from colibri.sitl.vehicle import Sitl


class Fleet(tuple[Sitl, ...], Stepped):
    """Vehicles that share one simulated time; flying one of them, or the fleet, flies all."""

    __slots__ = ()

    def __new__(cls, vehicles: Iterable[Sitl] = ()) -> "Fleet":
        fleet = super().__new__(cls, vehicles)
        for sitl in fleet:
            sitl.fleet = fleet
        if fleet:
            max(fleet, key=lambda sitl: sitl.time_us).have_others_catch_up()
        return fleet

    @property
    def time_us(self) -> int:
        """Simulated time of the last vehicle, µs."""
        return min(sitl.time_us for sitl in self)

    def step(self) -> None:
        """Fly one frame."""
        min(self, key=lambda sitl: sitl.time_us).step()

    def __str__(self) -> str:
        return "; ".join(f"vehicle {sitl.system}: {sitl}" for sitl in self)


def begin_fleet(
    flights: Flights,
    count: int,
    *,
    spacing: float = 0.0,
    places: Sequence[tuple[float, float]] | None = None,
    **changes: Any,
) -> Fleet:
    """Begin a fleet.

    Args:
        spacing: Distance between neighbours to the east, m.
        places: East and north of each vehicle from the default start, m; replaces `spacing`.
        changes: Applied to the test's setting, for all vehicles.
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
