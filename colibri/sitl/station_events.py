"""Events of a flight that a ground station sends: modes and setpoints."""

from collections import deque
from collections.abc import Iterable

from colibri.autopilot.commander.rules.modes import Mode, custom_mode
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, mav
from colibri.plant.events import Event, Setpoint
from colibri.plant.events import Mode as ModeEvent
from colibri.sitl.stepping import Steered

_SETPOINTS_EVERY_US = 50_000
_NEVER_US = 1 << 62


class StationEvents:
    """Sends the events of one vehicle; `next_us` is the time of the next."""

    def __init__(self, events: Iterable[Event]) -> None:
        self._coming = deque(it for it in events if isinstance(it, ModeEvent | Setpoint))
        self._held: Setpoint | None = None
        self.next_us = self._coming_us

    @property
    def _coming_us(self) -> int:
        return round(self._coming[0].t * 1e6) if self._coming else _NEVER_US

    def send(self, vehicle: Steered, now_us: int) -> None:
        """Send what is due; a setpoint goes on until the next, or a mode other than offboard."""
        while self._coming_us <= now_us:
            event = self._coming.popleft()
            if isinstance(event, Setpoint):
                self._held = event
                continue
            self._held = self._held if event.mode == Mode.OFFBOARD else None
            number = custom_mode(Mode(event.mode))
            numbers = (1.0, number >> 16 & 0xFF, number >> 24 & 0xFF, 0.0, 0.0, 0.0, 0.0)
            target = (vehicle.system, AUTOPILOT_COMPONENT)
            vehicle.send("COMMAND_LONG", *target, mav.MAV_CMD_DO_SET_MODE, 0, *numbers)
        again_us = _NEVER_US
        if self._held is not None:
            vehicle.setpoint(self._held.position, self._held.velocity, yaw=self._held.yaw)
            again_us = now_us + _SETPOINTS_EVERY_US
        self.next_us = min(self._coming_us, again_us)
