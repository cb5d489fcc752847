"""The heartbeat microservice: says that the vehicle is there and how it is, hears which ground stations are.

Specification: mavlink.io/en/services/heartbeat.html: HEARTBEAT at 1 Hz.
"""

from collections.abc import Iterable
from typing import NamedTuple

from colibri.mavlink.node.service import Fields, Peer, Send, to_all
from colibri.mavlink.services.identity import Identity
from colibri.mavlink.telemetry.snapshot import Snapshot
from colibri.mavlink.wire.dialect import MODE_ARMED, MODE_CUSTOM, TYPE_QUADROTOR, Message, mav

EVERY_US = 1_000_000
MAVLINK_VERSION = 3
MAX_HEARD = 64
"""Others that are remembered: whoever was silent longest is forgotten first."""


class Heard(NamedTuple):
    """Another component on the network.

    Attributes:
        peer: Who, and on which channel it was heard last.
        kind: MAV_TYPE.
        at_us: Simulated time of its last HEARTBEAT.
    """

    peer: Peer
    kind: int
    at_us: int


class HeartbeatService:
    """Sends the vehicle's HEARTBEAT, at once when its mode changes; remembers those of others.

    Attributes:
        expected_us: When a ground station began to be waited for that was heard before a restart; None for none.
    """

    handles = frozenset({"HEARTBEAT"})

    def __init__(self, identity: Identity) -> None:
        """Speak as `identity`."""
        self._identity = identity
        self._snapshot: Snapshot | None = None
        self._told: tuple[object, ...] | None = None
        self._told_at_us = -EVERY_US
        self._heard: dict[tuple[int, int], Heard] = {}
        self.expected_us: int | None = None

    def expect(self, now_us: int) -> None:
        """Wait from now on for a ground station that was heard before a restart."""
        self.expected_us = now_us

    def update(self, snapshot: Snapshot) -> None:
        """Take in how the vehicle is."""
        self._snapshot = snapshot

    def receive(self, message: Message, peer: Peer, now_us: int) -> Iterable[Send]:
        """Remember who is there."""
        key = (peer.system, peer.component)
        self._heard.pop(key, None)
        if len(self._heard) >= MAX_HEARD:
            del self._heard[next(iter(self._heard))]
        self._heard[key] = Heard(peer, message.fields.type, now_us)
        return ()

    def poll(self, now_us: int) -> Iterable[Send]:
        """Send a heartbeat once a second and whenever it says something new."""
        s = self._snapshot
        if s is None:
            return ()
        news = (s.armed, s.custom_mode, s.base_mode, s.failsafe, s.emergency, s.terminated)
        if news == self._told and 0 <= now_us - self._told_at_us < EVERY_US:
            return ()
        self._told, self._told_at_us = news, now_us
        return (to_all("HEARTBEAT", *self.fields(s)),)

    def fields(self, s: Snapshot) -> Fields:
        """Return the fields of HEARTBEAT (0)."""
        armed = MODE_ARMED if s.armed else 0
        mode = (s.base_mode | MODE_CUSTOM | armed) & 0xFF
        return (TYPE_QUADROTOR, self._identity.autopilot, mode, s.custom_mode, _state(s), MAVLINK_VERSION)

    def heard(self) -> list[Heard]:
        """Return everybody who was ever heard, the last one last."""
        return list(self._heard.values())

    @property
    def station_us(self) -> int | None:
        """When a ground station (MAV_TYPE_GCS) was heard last, or expected; None if there never was one."""
        heard = (other.at_us for other in self._heard.values() if other.kind == mav.MAV_TYPE_GCS)
        return max(heard, default=self.expected_us)


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
