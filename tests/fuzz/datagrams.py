"""Datagrams that nobody should have to fear: random bytes, and frames whose CRC is right and whose content is not.

What is not made here: a valid message of the genuine peer that names just the moment awaited. It could not be told from
the peer's own without signing.
"""

import random
import struct
from collections.abc import Callable
from math import inf, nan

from pymavlink.dialects.v20 import common

Ids = tuple[int, int]

AUTOPILOT: Ids = (1, 1)
PLANT: Ids = (1, common.MAV_COMP_ID_USER1)
HEARTBEAT, ATTITUDE, POSITION, COMMAND, ACK, ACTUATORS = 0, 31, 32, 76, 77, 93

_SIGNED = 0x01
_BAD_FLOATS = (nan, inf, -inf, 3.4e38, -3.4e38, 1e-45)
_KNOWN = sorted(common.mavlink_map)
_LARGEST_ID = 0xFFFFFF
_FRAME_US = 100_000


def frame(message_id: int, payload: bytes, source: Ids, *, sequence: int = 0, crc_extra: int | None = None) -> bytes:
    """Return a MAVLink 2 frame around any payload, its CRC right for the message unless another extra is given."""
    header = struct.pack("<BBBBBB", len(payload), 0, 0, sequence, *source) + message_id.to_bytes(3, "little")
    if crc_extra is None:
        crc_extra = common.mavlink_map[message_id].crc_extra if message_id in common.mavlink_map else 0
    return b"\xfd" + header + payload + _crc(header + payload, crc_extra)


def frame_v1(message_id: int, payload: bytes, source: Ids) -> bytes:
    """Return a MAVLink 1 frame around any payload."""
    body = struct.pack("<BBBBB", len(payload), 0, *source, message_id) + payload
    return b"\xfe" + body + _crc(body, common.mavlink_map[message_id].crc_extra)


def _crc(content: bytes, extra: int) -> bytes:
    return struct.pack("<H", common.x25crc(bytearray(content) + bytes([extra])).crc)


class Fuzzer:
    """Makes datagrams by chance.

    Args:
        chance: Where the chance comes from.
        peer: Whom the receiver listens to.
        receiver: Whom the datagrams are for.
    """

    def __init__(self, chance: random.Random, peer: Ids, receiver: Ids) -> None:
        """Aim at `receiver`, in the name of `peer` where that is hostile."""
        self._chance = chance
        self._peer = peer
        self._receiver = receiver
        self._kinds: tuple[Callable[[], bytes], ...] = (
            self._any_message,
            self._wrong_length,
            self._unknown_id,
            self._foreign,
            self._state_halves,
            self._actuators,
            self._heartbeat,
            self._command,
            self._ack,
            self._signed,
            self._version_1,
        )

    def random(self) -> bytes:
        """Return random bytes; some begin like a frame, some are a spoilt one."""
        chance = self._chance
        kind = chance.randrange(4)
        if kind == 0:
            return chance.randbytes(chance.randrange(600))
        if kind == 1:
            return chance.choice((b"\xfd", b"\xfe")) + chance.randbytes(chance.randrange(300))
        spoilt = bytearray(self.hostile())
        if kind == 2:
            return bytes(spoilt[: chance.randrange(len(spoilt))])
        spoilt[chance.randrange(len(spoilt))] ^= chance.randrange(1, 256)
        return bytes(spoilt)

    def hostile(self) -> bytes:
        """Return one to three frames with right CRCs and wrong contents."""
        return b"".join(self._chance.choice(self._kinds)() for _ in range(self._chance.choice((1, 1, 1, 2, 3))))

    def _any_message(self) -> bytes:
        """Any message of the dialect that is not part of the conversation, with random content."""
        message_id = self._chance.choice(_KNOWN)
        if message_id in (HEARTBEAT, ATTITUDE, POSITION, COMMAND, ACK, ACTUATORS):
            message_id = common.MAVLINK_MSG_ID_ATTITUDE
        size = common.mavlink_map[message_id].unpacker.size
        return frame(message_id, self._chance.randbytes(size), self._peer, sequence=self._chance.randrange(256))

    def _wrong_length(self) -> bytes:
        """A message cut short, or longer than it is defined; never enough of it to be a valid one."""
        message_id = self._chance.choice((ATTITUDE, POSITION, ACTUATORS))
        length = self._chance.choice((0, 1, self._chance.randrange(2, 12), 255))
        return frame(message_id, b"\xff" * length, self._peer)

    def _unknown_id(self) -> bytes:
        message_id = self._chance.choice((_LARGEST_ID, self._chance.randrange(60_000, _LARGEST_ID)))
        return frame(message_id, self._chance.randbytes(self._chance.randrange(256)), self._peer)

    def _foreign(self) -> bytes:
        """What the peer could well have said, said by somebody else."""
        source = self._chance.choice(((2, self._peer[1]), (self._peer[0], 77), (255, 190), (0, 0)))
        time_us = _FRAME_US * self._chance.randrange(1000)
        return self._valid_state(time_us, source) + self._valid_actuators(time_us, source)

    def _state_halves(self) -> bytes:
        """Both halves of a frame in the peer's name: one of them broken, or the frame out of step."""
        time_us = _FRAME_US * self._chance.randrange(1000)
        if self._chance.random() < 0.5:
            return self._valid_state(time_us + 1000 * self._chance.randrange(1, 100), self._peer)
        values = [self._value() for _ in range(12)]
        values[self._chance.randrange(12)] = self._chance.choice(_BAD_FLOATS[:3])
        attitude = struct.pack("<I7f", time_us // 1000, *self._quaternion(), *values[:3])
        position = struct.pack("<I6f", time_us // 1000 + self._chance.choice((0, 1)), *values[3:9])
        broken = any(value != value or abs(value) == inf for value in values[:9])
        halves = [frame(ATTITUDE, attitude, self._peer), frame(POSITION, position, self._peer)]
        return b"".join(halves if broken else halves[:1])

    def _actuators(self) -> bytes:
        """A command in the peer's name: one control that no rotor can follow, or a moment that nobody awaits."""
        if self._chance.random() < 0.5:
            return self._valid_actuators(self._chance.getrandbits(64) | 1, self._peer)
        controls = [self._chance.random() for _ in range(16)]
        controls[self._chance.randrange(4)] = self._chance.choice((*_BAD_FLOATS[:5], -1.0, 1.5))
        time_us = _FRAME_US * self._chance.randrange(1000)
        return frame(ACTUATORS, struct.pack("<QQ16fB", time_us, 1, *controls, 0xFF), self._peer)

    def _heartbeat(self) -> bytes:
        return frame(HEARTBEAT, self._chance.randbytes(9), self._peer)

    def _command(self) -> bytes:
        """A command: any, or another frame interval, which a flight that has begun must refuse."""
        command = self._chance.choice((511, 400, self._chance.randrange(65536)))
        parameters = [31.0, *(self._value() for _ in range(6))]
        target = self._chance.choice((self._receiver, (0, 0), (9, 9)))
        return frame(COMMAND, struct.pack("<7fHBBB", *parameters, command, *target, 0), self._peer)

    def _ack(self) -> bytes:
        return frame(ACK, self._chance.randbytes(10), self._peer)

    def _signed(self) -> bytes:
        """A frame that says it is signed; what it holds is not worth obeying either."""
        content = bytearray(self._valid_actuators(1, self._peer))
        content[2] = _SIGNED
        crc = _crc(bytes(content[1:-2]), common.mavlink_map[ACTUATORS].crc_extra)
        return bytes(content[:-2]) + crc + self._chance.randbytes(13)

    def _version_1(self) -> bytes:
        return frame_v1(HEARTBEAT, self._chance.randbytes(9), self._peer)

    def _valid_state(self, time_us: int, source: Ids) -> bytes:
        attitude = struct.pack("<I7f", time_us // 1000, *self._quaternion(), 0.0, 0.0, 0.0)
        position = struct.pack("<I6f", time_us // 1000, *(self._chance.gauss(0.0, 10.0) for _ in range(6)))
        return frame(ATTITUDE, attitude, source) + frame(POSITION, position, source)

    def _valid_actuators(self, time_us: int, source: Ids) -> bytes:
        controls = [self._chance.random() for _ in range(16)]
        return frame(ACTUATORS, struct.pack("<QQ16fB", time_us, 1, *controls, 0x80), source)

    def _quaternion(self) -> tuple[float, float, float, float]:
        return self._chance.choice(((1.0, 0.0, 0.0, 0.0), (0.5, 0.5, 0.5, 0.5), (0.0, 0.6, 0.8, 0.0)))

    def _value(self) -> float:
        return self._chance.choice((*_BAD_FLOATS, 0.0, self._chance.gauss(0.0, 1e5), self._chance.random()))
