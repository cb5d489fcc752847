"""The heartbeat microservice: mavlink.io/en/services/heartbeat.html."""

from collections.abc import Iterable

from colibri.mavlink.node.service import Fields, Peer, Send, to_all
from colibri.mavlink.services.identity import Identity
from colibri.mavlink.telemetry.snapshot import TelemetrySnapshot
from colibri.mavlink.wire.dialect import MODE_ARMED, MODE_CUSTOM, Message, mav, vehicle_type

EVERY_US = 1_000_000
MAVLINK_VERSION = 3


class HeartbeatService:
    """Sends the vehicle's HEARTBEAT, at once after mode changes; tracks ground stations."""

    handles = frozenset({"HEARTBEAT"})

    def __init__(self, identity: Identity) -> None:
        self._identity = identity
        self._snapshot: TelemetrySnapshot | None = None
        self._sent: tuple[object, ...] | None = None
        self._sent_at_us = -EVERY_US
        self.station_us: int | None = None  # last ground station's (MAV_TYPE_GCS)

    def update(self, snapshot: TelemetrySnapshot) -> None:
        self._snapshot = snapshot

    def go_on(self, custom_mode: int, *, armed: bool) -> None:
        """Continue with this mode without newer state of the vehicle."""
        if self._snapshot is not None:
            self._snapshot = self._snapshot._replace(custom_mode=custom_mode, armed=armed)

    def receive(self, message: Message, _peer: Peer, now_us: int) -> Iterable[Send]:
        if message.fields.type == mav.MAV_TYPE_GCS:
            self.station_us = now_us
        return ()

    def poll(self, now_us: int) -> Iterable[Send]:
        s = self._snapshot
        if s is None:
            return ()
        news = (s.armed, s.custom_mode, s.base_mode, s.failsafe, s.emergency, s.terminated)
        if news == self._sent and 0 <= now_us - self._sent_at_us < EVERY_US:
            return ()
        self._sent, self._sent_at_us = news, now_us
        return (to_all("HEARTBEAT", *self.fields(s)),)

    def fields(self, s: TelemetrySnapshot) -> Fields:
        armed = MODE_ARMED if s.armed else 0
        mode = (s.base_mode | MODE_CUSTOM | armed) & 0xFF
        kind = vehicle_type(len(s.controls))
        return (kind, self._identity.autopilot, mode, s.custom_mode, self._state(s), MAVLINK_VERSION)

    def _state(self, s: TelemetrySnapshot) -> int:
        if not self._identity.stands_by:
            return _state(s)
        if s.failsafe:
            return int(mav.MAV_STATE_CRITICAL)
        return int(mav.MAV_STATE_STANDBY if s.landed_state == mav.MAV_LANDED_STATE_ON_GROUND else mav.MAV_STATE_ACTIVE)


def _state(s: TelemetrySnapshot) -> int:
    state: int = mav.MAV_STATE_ACTIVE if s.armed else mav.MAV_STATE_STANDBY
    if s.failsafe:
        state = mav.MAV_STATE_CRITICAL
    if s.emergency:
        state = mav.MAV_STATE_EMERGENCY
    if s.terminated:
        state = mav.MAV_STATE_FLIGHT_TERMINATION
    return state
