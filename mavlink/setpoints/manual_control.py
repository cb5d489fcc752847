"""Manual control: the sticks of a ground station, as MANUAL_CONTROL or as RC_CHANNELS_OVERRIDE.

Specification: https://mavlink.io/en/services/manual_control.html and common.xml, messages MANUAL_CONTROL (69) and
RC_CHANNELS_OVERRIDE (70). Neither is answered. The signs of the yaw stick are the clients': to the right is positive,
as PX4 and all who fly it have it, though the message's text has counter-clockwise positive. Buttons are not looked at.
"""

from typing import Any, NamedTuple

from colibri.mavlink.node.service import Peer
from colibri.mavlink.setpoints.arbitration import SILENT_AFTER_US, Refused, StreamedService
from colibri.mavlink.setpoints.setpoints import Sticks
from colibri.mavlink.wire.dialect import Message

FULL = 1000
UNUSED = 0x7FFF
"""INT16_MAX: the axis is not there; its stick is in the middle."""

RELEASED, UNCHANGED = 0, 0xFFFF
"""Of channels 1 to 8: 0 gives a channel back to the radio, UINT16_MAX leaves it as it is."""
MIN_US, MIDDLE_US, MAX_US = 1000, 1500, 2000
VALID_US = (800, 2200)
"""Transmitters go beyond 1000 and 2000 µs; what lies in here counts as a full stick."""
_ALL_RELEASED = (RELEASED, RELEASED, RELEASED, RELEASED)

Channels = tuple[int, int, int, int]
"""The first four: aileron, elevator, throttle, rudder."""


class Controls(NamedTuple):
    """What one client holds: its sticks, and the channels that they are made of, if any."""

    sticks: Sticks
    channels: Channels = _ALL_RELEASED


class Manual(StreamedService[Controls]):
    """Keeps the latest sticks of each client; see `arbitration` for which client is obeyed."""

    handles = frozenset({"MANUAL_CONTROL", "RC_CHANNELS_OVERRIDE"})

    def __init__(self, system_id: int) -> None:
        """Be the vehicle `system_id`."""
        super().__init__()
        self._system_id = system_id

    def latest(self, now_us: int, timeout_us: int) -> Sticks | None:
        """Return the latest sticks of the client that is obeyed, if they are no older than `timeout_us`."""
        controls = self._latest(now_us, timeout_us)
        return controls.sticks if controls else None

    def _decode(self, message: Message, peer: Peer, now_us: int) -> Controls | None:
        if message.name == "RC_CHANNELS_OVERRIDE":
            return self._decode_channels(message.fields, peer, now_us)
        fields = message.fields
        if fields.target not in (self._system_id, 0):
            raise Refused("another vehicle")
        axes = (fields.x, fields.y, fields.z, fields.r)
        if not all(axis == UNUSED or -FULL <= axis <= FULL for axis in axes):
            raise Refused("out of range")
        pitch, roll, yaw = (0.0 if axis == UNUSED else axis / FULL for axis in (fields.x, fields.y, fields.r))
        # "negative values are negative thrust", which no rotor of ours makes
        thrust = 0.5 if fields.z == UNUSED else max(fields.z, 0) / FULL
        return Controls(Sticks(pitch, roll, thrust, yaw, now_us))

    def _decode_channels(self, fields: Any, peer: Peer, now_us: int) -> Controls | None:
        wire = (fields.chan1_raw, fields.chan2_raw, fields.chan3_raw, fields.chan4_raw)
        minimum, maximum = VALID_US
        if not all(value in (RELEASED, UNCHANGED) or minimum <= value <= maximum for value in wire):
            raise Refused("out of range")
        before = self._value(peer, now_us, SILENT_AFTER_US)
        held = before.channels if before else _ALL_RELEASED
        c1, c2, c3, c4 = (old if new == UNCHANGED else new for new, old in zip(wire, held, strict=True))
        channels = (c1, c2, c3, c4)
        if channels != _ALL_RELEASED:
            return Controls(sticks_of(channels, now_us), channels)
        if held != _ALL_RELEASED:
            del self._received[peer]
        return None


def sticks_of(channels: Channels, now_us: int) -> Sticks:
    """Return the sticks of four channels, µs; one that is released is in the middle, as there is no radio.

    A low value of the elevator's channel is its stick forward, as transmitters for copters have it.
    """
    roll, pitch, thrust, yaw = (
        0.0 if value == RELEASED else (min(max(value, MIN_US), MAX_US) - MIDDLE_US) / (MAX_US - MIDDLE_US)
        for value in channels
    )
    return Sticks(-pitch, roll, 0.5 + 0.5 * thrust, yaw, now_us)
