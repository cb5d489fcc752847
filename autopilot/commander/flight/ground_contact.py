"""Contact with the ground: whether the vehicle stands, and when it was armed, took off and landed."""

from typing import NamedTuple

from colibri.autopilot.commander.rules.modes import Event
from colibri.autopilot.commander.status_queue import StatusQueue
from colibri.autopilot.control.interface import VehicleState
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.guidance.landing_detector import Landing, is_clear, watch
from colibri.mavlink.services.statustext import INFO, NOTICE


class FlightTimes(NamedTuple):
    """Times of the last arming, take-off and landing, simulated time, 0 before; and how often the rotors were armed."""

    armed_us: int = 0
    takeoff_us: int = 0
    landing_us: int = 0
    flights: int = 0


class GroundRecord(NamedTuple):
    """State of the ground contact as plain data; the fields are attributes of `GroundContact`."""

    standing: bool
    idles: bool
    height_m: float
    times: FlightTimes


class GroundContact:
    """Contact of one vehicle with the ground.

    Attributes:
        idles: Whether the rotors stand or idle.
        height_m: Height of where it last stood, z of ENU, m.
    """

    def __init__(self, lines: StatusQueue) -> None:
        self._lines = lines
        self._landing = Landing()
        self.standing = self.idles = True
        self.height_m = 0.0
        self.times = FlightTimes()

    def begin(self, now_us: int, *, standing: bool) -> None:
        """Set whether the vehicle stands as it is first seen, at `now_us`; the count of flights stays."""
        self.times = FlightTimes(flights=self.times.flights)
        self.standing = self.idles = standing
        if not standing:
            self.take_off(now_us)

    def record(self) -> GroundRecord:
        """Return the state for a restart."""
        return GroundRecord(self.standing, self.idles, self.height_m, self.times)

    def resume(self, record: GroundRecord, *, came_down: bool) -> None:
        """Restore the state after a restart, standing if the vehicle `came_down` meanwhile."""
        self.standing, self.idles, self.height_m, self.times = record
        self.standing |= came_down
        self.idles |= came_down

    def clear(self, vehicle: VehicleState) -> bool:
        """Whether a vehicle has left the ground and is clear of it."""
        return not self.standing and is_clear(self._landing, vehicle, self.height_m)

    def arm(self, now_us: int) -> None:
        """Count a flight that begins with the arming at `now_us`."""
        self.times = self.times._replace(armed_us=now_us, flights=self.times.flights + 1)

    def spin_up(self) -> bool:
        """Leave idle; return whether the rotors stood or idled until now."""
        idled, self.idles = self.idles, False
        return idled

    def take_off(self, now_us: int) -> None:
        """Leave the ground at `now_us`."""
        self.standing = False
        self._landing = Landing()
        self.times = self.times._replace(takeoff_us=now_us)
        self._lines.say(INFO, "take-off")

    def land(self, now_us: int) -> None:
        """Stand from `now_us` on."""
        self.standing = True
        self.times = self.times._replace(landing_us=now_us)
        self._lines.say(NOTICE, "landing detected")

    def watch(self, now_us: int, vehicle: VehicleState, *, sinks: bool, drifts: bool = False) -> None:
        """Detect a landing of a vehicle in flight; `sinks` and `drifts` as of `landing_detector.watch`."""
        self._landing, stands = watch(self._landing, now_us, vehicle, sinks, drifts=drifts)
        if stands:
            self.land(now_us)

    def rest(self, now_us: int, vehicle: VehicleState) -> None:
        """Take in a sample of a vehicle that lies, or falls, with the rotors standing still or idle."""
        self.idles = True
        self._landing, lies = watch(self._landing, now_us, vehicle, sinks=True)
        self.standing = self.standing or lies
        if self.standing:
            self.height_m = vehicle.position_enu_m[2]

    def stop(self) -> None:
        """Restart landing detection as the rotors stop."""
        self._landing = Landing()

    def end_of_idling(self, now_us: int, behaviour: Behaviour) -> Event | None:
        """Return the event that stops rotors that idle on the ground; None while they may go on."""
        landed = self.times.landing_us > self.times.armed_us
        on_ground_us = now_us - max(self.times.armed_us, self.times.landing_us)
        allowed_s = behaviour.disarm_after_landing_s if landed else behaviour.disarm_on_ground_s
        if allowed_s <= 0.0 or on_ground_us < allowed_s * 1e6:
            return None
        return Event.TOUCHED_DOWN if landed else Event.LEFT_STANDING
