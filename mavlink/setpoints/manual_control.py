"""Manual control: a ground station's sticks, as MANUAL_CONTROL (69) or RC_CHANNELS_OVERRIDE (70).

Specification: https://mavlink.io/en/services/manual_control.html. Yaw is positive to the right, as in PX4, although the
message's text is counter-clockwise. Buttons are ignored.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

from colibri.mavlink.node.service import Peer
from colibri.mavlink.services.statustext import StatusText
from colibri.mavlink.setpoints.arbitration import SILENT_AFTER_US, Refused, StreamedService
from colibri.mavlink.setpoints.setpoints import Sticks
from colibri.mavlink.wire.dialect import Message

FULL = 1000
UNUSED = 0x7FFF  # INT16_MAX: a missing axis; its stick is centred

RELEASED, UNCHANGED = 0, 0xFFFF  # of channels 1 to 8: returned to the radio, or left as they are
MIN_US, MIDDLE_US, MAX_US = 1000, 1500, 2000
VALID_US = (800, 2200)  # transmitters exceed 1000 and 2000 µs; values beyond count as full
_ALL_RELEASED = (RELEASED, RELEASED, RELEASED, RELEASED)

Channels = tuple[int, int, int, int]  # the first four: aileron, elevator, throttle, rudder


class Controls(NamedTuple):
    """A client's sticks, and the channels behind them, if any."""

    sticks: Sticks
    channels: Channels = _ALL_RELEASED


class Manual(StreamedService[Controls]):
    """Keeps each client's latest sticks."""

    handles = frozenset({"MANUAL_CONTROL", "RC_CHANNELS_OVERRIDE"})

    def __init__(self, system_id: int, text: StatusText | None = None) -> None:
        super().__init__(text=text)
        self._system_id = system_id
        self.held: tuple[int, ...] = ()  # channels of a radio, us; empty without one

    def latest(self, now_us: int, timeout_us: int) -> Sticks | None:
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
            raise Refused("out of range", f"x, y, z, r {axes}")
        pitch, roll, yaw = (0.0 if axis == UNUSED else axis / FULL for axis in (fields.x, fields.y, fields.r))
        # "negative values are negative thrust", which no rotor of ours makes
        thrust = 0.5 if fields.z == UNUSED else max(fields.z, 0) / FULL
        return Controls(Sticks(pitch, roll, thrust, yaw, now_us))

    def _decode_channels(self, fields: Any, peer: Peer, now_us: int) -> Controls | None:
        wire = (fields.chan1_raw, fields.chan2_raw, fields.chan3_raw, fields.chan4_raw)
        minimum, maximum = VALID_US
        if not all(value in (RELEASED, UNCHANGED) or minimum <= value <= maximum for value in wire):
            raise Refused("out of range", f"channels 1 to 4 {wire}")
        before = self._value(peer, now_us, SILENT_AFTER_US)
        held = before.channels if before else _ALL_RELEASED
        c1, c2, c3, c4 = (old if new == UNCHANGED else new for new, old in zip(wire, held, strict=True))
        channels = (c1, c2, c3, c4)
        if channels != _ALL_RELEASED:
            return Controls(sticks_of(channels, now_us), channels)
        if held != _ALL_RELEASED:
            del self._received[peer]
        return None


def sticks_of(channels: Sequence[int], now_us: int) -> Sticks:
    """Return the sticks of the first four channels, µs; released is centred, a low elevator is the stick forward."""
    roll, pitch, thrust, yaw = (
        0.0 if value == RELEASED else (min(max(value, MIN_US), MAX_US) - MIDDLE_US) / (MAX_US - MIDDLE_US)
        for value in channels[:4]
    )
    return Sticks(-pitch, roll, 0.5 + 0.5 * thrust, yaw, now_us)
