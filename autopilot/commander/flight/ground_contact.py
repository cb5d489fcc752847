"""Ground contact, and the times of arming, take-off and landing."""

from collections import deque
from math import hypot
from typing import NamedTuple

from colibri.autopilot.commander.rules.modes import Event
from colibri.autopilot.commander.status_queue import StatusQueue
from colibri.autopilot.control.interface import VehicleState
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.guidance.landing_detector import (
    HARD_WITHIN_US,
    KNOCK_SAMPLES,
    SUSPECTED_S,
    Hardest,
    Held,
    Lack,
    Landing,
    Motion,
    Scrape,
    is_clear,
    is_far_below,
    is_held_down,
    is_touching,
    knock,
    watch,
)
from colibri.common.records import Record
from colibri.mavlink.services.statustext import CRITICAL, INFO, NOTICE


class FlightTimes(NamedTuple):
    """Simulated times of the last events, 0 before the first, and the number of armings."""

    armed_us: int = 0
    takeoff_us: int = 0
    landing_us: int = 0
    flights: int = 0


class GroundRecord(Record, frozen=True):
    """Attributes of `GroundContact` for a restart."""

    standing: bool
    idles: bool
    height_m: float
    times: FlightTimes


class GroundContact:
    """Ground contact of one vehicle.

    Attributes:
        impact: Text, empty for a landing.
        drifts: Whether its speed is unknown.
        height_m: Last z of ENU on the ground.
    """

    def __init__(self, lines: StatusQueue) -> None:
        self._lines = lines
        self._landing = Landing()
        self._lack, self._hardest, self._held, self._scrape = Lack(), Hardest(), Held(), Scrape()
        self._motions: deque[Motion] = deque(maxlen=KNOCK_SAMPLES)
        self.impact = ""
        self.drifts = False
        self.standing = self.idles = True
        self.height_m = 0.0
        self.times = FlightTimes()

    def begin(self, now_us: int, *, standing: bool) -> None:
        self.times = FlightTimes(flights=self.times.flights)
        self.standing = self.idles = standing
        if not standing:
            self.take_off(now_us)

    def record(self) -> GroundRecord:
        return GroundRecord(self.standing, self.idles, self.height_m, self.times)

    def resume(self, record: GroundRecord, *, came_down: bool) -> None:
        """Restore the state; a vehicle that `came_down` meanwhile stands."""
        self.standing, self.idles = record.standing or came_down, record.idles or came_down
        self.height_m, self.times = record.height_m, record.times

    def clear(self, vehicle: VehicleState) -> bool:
        return not self.standing and is_clear(self._landing, vehicle, self.height_m)

    def arm(self, now_us: int) -> None:
        self.times = self.times._replace(armed_us=now_us, flights=self.times.flights + 1)

    def spin_up(self) -> bool:
        idled, self.idles = self.idles, False
        return idled

    def take_off(self, now_us: int) -> None:
        self.standing = False
        self._landing, self._lack, self._hardest, self._held = Landing(), Lack(), Hardest(), Held()
        self._scrape = Scrape()
        self._motions.clear()
        self.times = self.times._replace(takeoff_us=now_us)
        self._lines.say(INFO, "Takeoff detected")

    def land(self, now_us: int) -> None:
        self.standing = True
        self.times = self.times._replace(landing_us=now_us)
        self.impact = self._hardest.impact(now_us)
        if self.impact:
            self._lines.say(CRITICAL, self.impact)
        else:
            self._lines.say(NOTICE, "Landing detected" + (", at an unknown speed" if self.drifts else ""))

    def watch(self, now_us: int, vehicle: VehicleState, wanted_m: float, *, sinks: bool, drifts: bool = False) -> bool:
        """Detect ground in flight; return whether the vehicle fell below the wanted height."""
        motion, motions = Motion(now_us, vehicle.velocity_enu_m_s), self._motions
        knocked = knock(motions[0], motion, vehicle.position_enu_m[2] - self.height_m) if motions else ""
        if knocked:
            self._lines.say(CRITICAL, knocked)
            motions.clear()
        motions.append(motion)
        if self._lack.lack_s < SUSPECTED_S:
            hardest = self._hardest.after(now_us, vehicle)
            past = hardest is self._hardest and not drifts and hardest.is_past(vehicle)
            self._hardest = Hardest() if past else hardest
        fell = not sinks and self._hardest.is_recent(now_us) and is_held_down(wanted_m, vehicle, self.height_m)
        self._landing, stands = watch(
            self._landing, now_us, vehicle, sinks or fell, drifts=drifts, slides=is_far_below(wanted_m, vehicle)
        )
        self._held = self._held.after(now_us, wanted_m, vehicle)
        self._scrape = self._scrape.after(now_us, wanted_m, vehicle, self.height_m)
        if self._scrape.is_long(now_us):
            self._lines.say(CRITICAL, f"Impact at {hypot(*vehicle.velocity_enu_m_s):.1f} m/s")
            self._scrape = Scrape(now_us + HARD_WITHIN_US)
        if stands or self._held.is_long(now_us):
            self.land(now_us)
        return stands and fell

    def watch_forces(
        self, now_us: int, vehicle: VehicleState, lift: float, push: float, jolt_s: float, interval_s: float
    ) -> bool:
        """Detect ground by forces while the vehicle comes down; return whether the contact was an impact."""
        climb_m_s = vehicle.velocity_enu_m_s[2]
        self._lack = self._lack.after(lift, climb_m_s, interval_s)
        touches = is_touching(push, jolt_s, vehicle, self.height_m)
        if self.standing or not (touches or self._lack.is_carried(climb_m_s)):
            return False
        self.land(now_us)
        return bool(self.impact)

    def rest(self, now_us: int, vehicle: VehicleState) -> None:
        """Process a sample with rotors stopped or idling, also in a fall."""
        self.idles = True
        self._landing, lies = watch(self._landing, now_us, vehicle, sinks=True)
        if not self.standing:
            self._hardest = self._hardest.after(now_us, vehicle)
            if lies and self._hardest.impact(now_us):
                self.land(now_us)
        self.standing = self.standing or lies
        if self.standing:
            self.height_m = vehicle.position_enu_m[2]

    def stop(self) -> None:
        self._landing = Landing()

    def end_of_idling(self, now_us: int, behaviour: Behaviour, *, by_sticks: bool = False) -> Event | None:
        landed = self.times.landing_us > self.times.armed_us and (not by_sticks or behaviour.stick_landings_end)
        on_ground_us = now_us - max(self.times.armed_us, self.times.landing_us)
        allowed_s = behaviour.disarm_after_landing_s if landed else behaviour.disarm_on_ground_s
        if allowed_s <= 0.0 or on_ground_us < allowed_s * 1e6:
            return None
        return Event.TOUCHED_DOWN if landed else Event.LEFT_STANDING
