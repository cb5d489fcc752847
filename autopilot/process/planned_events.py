"""Events that a ground station sends; loads fast, for launchers."""

from collections.abc import Iterable

from colibri.autopilot.commander.rules.modes import Mode as FlightMode
from colibri.common.errors import unknown
from colibri.mavlink.client.events import EventError, Mode, StationEvent


def station_events(events: Iterable[object]) -> tuple[StationEvent, ...]:
    """Return the events that a ground station sends; unknown modes raise EventError."""
    found = tuple(event for event in events if isinstance(event, StationEvent))
    for event in found:
        if isinstance(event, Mode) and event.mode not in set(FlightMode):
            raise EventError(unknown("mode", event.mode, FlightMode))
    return found
