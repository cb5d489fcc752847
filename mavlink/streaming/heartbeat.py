"""The heartbeat microservice: sends the vehicle's state, notes when a ground station was received last.

Specification: mavlink.io/en/services/heartbeat.html: HEARTBEAT at 1 Hz.
"""

from collections.abc import Iterable

from colibri.mavlink.node.service import Fields, Peer, Send, to_all
from colibri.mavlink.services.identity import Identity
from colibri.mavlink.telemetry.snapshot import Snapshot
from colibri.mavlink.wire.dialect import MODE_ARMED, MODE_CUSTOM, TYPE_QUADROTOR, Message, mav

EVERY_US = 1_000_000
MAVLINK_VERSION = 3


class HeartbeatService:
    """Sends the vehicle's HEARTBEAT, at once when its mode changes; receives those of ground stations.

    Attributes:
        station_us: When a ground station (MAV_TYPE_GCS) was received last, or expected; None if there never was one.
    """

    handles = frozenset({"HEARTBEAT"})

    def __init__(self, identity: Identity) -> None:
        """Speak as `identity`."""
        self._identity = identity
        self._snapshot: Snapshot | None = None
        self._sent: tuple[object, ...] | None = None
        self._sent_at_us = -EVERY_US
        self.station_us: int | None = None

    def expect(self, now_us: int) -> None:
        """Wait from now on for a ground station that was connected before a restart."""
        self.station_us = now_us

    def update(self, snapshot: Snapshot) -> None:
        """Set the vehicle's state, to be sent next."""
        self._snapshot = snapshot

    def go_on(self, custom_mode: int, *, armed: bool) -> None:
        """Send this from now on, where there is no newer state of the vehicle."""
        if self._snapshot is not None:
            self._snapshot = self._snapshot._replace(custom_mode=custom_mode, armed=armed)

    def receive(self, message: Message, peer: Peer, now_us: int) -> Iterable[Send]:
        """Note the time of a ground station's heartbeat."""
        del peer
        if message.fields.type == mav.MAV_TYPE_GCS:
            self.station_us = now_us
        return ()

    def poll(self, now_us: int) -> Iterable[Send]:
        """Send a heartbeat once a second, and at once when its fields change."""
        s = self._snapshot
        if s is None:
            return ()
        news = (s.armed, s.custom_mode, s.base_mode, s.failsafe, s.emergency, s.terminated)
        if news == self._sent and 0 <= now_us - self._sent_at_us < EVERY_US:
            return ()
        self._sent, self._sent_at_us = news, now_us
        return (to_all("HEARTBEAT", *self.fields(s)),)

    def fields(self, s: Snapshot) -> Fields:
        """Return the fields of HEARTBEAT (0)."""
        armed = MODE_ARMED if s.armed else 0
        mode = (s.base_mode | MODE_CUSTOM | armed) & 0xFF
        return (TYPE_QUADROTOR, self._identity.autopilot, mode, s.custom_mode, _state(s), MAVLINK_VERSION)


def _state(s: Snapshot) -> int:
    """MAV_STATE: a flight ended for good, one in distress, one that saves itself, motors that may turn, none of it."""
    state: int = mav.MAV_STATE_ACTIVE if s.armed else mav.MAV_STATE_STANDBY
    if s.failsafe:
        state = mav.MAV_STATE_CRITICAL
    if s.emergency:
        state = mav.MAV_STATE_EMERGENCY
    if s.terminated:
        state = mav.MAV_STATE_FLIGHT_TERMINATION
    return state
