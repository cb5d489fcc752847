"""Modes and setpoints sent at given times, as by a ground station."""

from collections import deque
from collections.abc import Iterable

from colibri.autopilot.commander.rules.modes import Mode as FlightMode
from colibri.autopilot.commander.rules.modes import custom_mode
from colibri.autopilot.core.step import Received
from colibri.autopilot.ground.stations import Stations
from colibri.autopilot.process.planned_events import station_events
from colibri.mavlink.client.conversation import Encoded
from colibri.mavlink.client.events import Setpoint
from colibri.mavlink.client.setpoints import position_target
from colibri.mavlink.streaming.rates import SILENT
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, Codec, mav
from colibri.mavlink.wire.signing import Signing

LINK = 1000  # number of the link of these events: beyond those of ground stations
_SETPOINTS_EVERY_US = 50_000
_NEVER_US = 1 << 62
_BEGINS_WITHIN_US = 5_000_000  # a flight's first estimate; sensors are aligned for a second


class StationEvents:
    """Encodes the events of one vehicle; `next_us` is the time of the next."""

    def __init__(self, events: Iterable[object], system_id: int) -> None:
        self._coming = deque(station_events(events))
        self._target = (system_id, AUTOPILOT_COMPONENT)
        self._held: Setpoint | None = None
        self.next_us = self._coming_us

    @property
    def _coming_us(self) -> int:
        return round(self._coming[0].t * 1e6) if self._coming else _NEVER_US

    def due(self, now_us: int) -> list[Encoded]:
        """Return what is due; a setpoint is repeated until the next, or another mode."""
        due: list[Encoded] = []
        while self._coming_us <= now_us:
            event = self._coming.popleft()
            if isinstance(event, Setpoint):
                self._held = event
                continue
            self._held = self._held if event.mode == FlightMode.OFFBOARD else None
            number = custom_mode(FlightMode(event.mode))
            due.append(self._command(mav.MAV_CMD_DO_SET_MODE, 1.0, number >> 16 & 0xFF, number >> 24 & 0xFF))
            if event.arm:
                due.append(self._command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0))
        again_us = _NEVER_US
        if self._held is not None:
            held, again_us = self._held, now_us + _SETPOINTS_EVERY_US
            due.append(position_target(self._target, held.position, held.velocity, yaw=held.yaw, time_us=now_us))
        self.next_us = min(self._coming_us, again_us)
        return due

    def _command(self, number: int, *params: float) -> Encoded:
        return "COMMAND_LONG", (*self._target, number, 0, *params, *(0.0,) * (7 - len(params)))


class EventStation:
    """A ground station in this process that sends the events at their simulated times."""

    def __init__(self, events: Iterable[object], system_id: int, signing: Signing) -> None:
        self._events = StationEvents(events, system_id)
        self._codec = Codec(system_id, mav.MAV_COMP_ID_ONBOARD_COMPUTER)
        self._signing = signing
        self._begun = False

    def introduce(self, stations: Stations) -> None:
        """Open the channel, which streams nothing: answers are not read."""
        stations.streams.use(stations.hub.open(LINK, None), SILENT)

    def due(self, now_us: int | None) -> list[Received]:
        """Return what is due; what is past at a restart was sent before."""
        if now_us is None or now_us < self._events.next_us:
            return []
        if not self._begun and now_us > _BEGINS_WITHIN_US:
            self._events.due(now_us - _BEGINS_WITHIN_US)
        self._begun = True
        signing = self._signing
        self._codec.seal = (lambda frame: signing.sign(frame, LINK)) if signing.active else None
        return [Received(self._codec.encode(name, *fields), LINK, None) for name, fields in self._events.due(now_us)]
