"""Hostile datagrams: random bytes, and frames with a right CRC and wrong content.

A valid message for the awaited moment is left out: only signing could tell it apart.
"""

import random
import struct
from collections.abc import Callable
from math import inf, nan
from struct import pack

from pymavlink.dialects.v20 import common

Ids = tuple[int, int]

AUTOPILOT: Ids = (1, common.MAV_COMP_ID_AUTOPILOT1)
PLANT: Ids = (1, common.MAV_COMP_ID_USER1)
HEARTBEAT, ATTITUDE, POSITION, COMMAND, ACK, ACTUATORS = 0, 31, 32, 76, 77, 93  # the messages of the conversation
KNOWN: tuple[int, ...] = tuple(sorted(common.mavlink_map))
MAX_MESSAGE_ID = 0xFFFFFF

_CRC_EXTRA_OF_THE_UNKNOWN = 0


def frame(message_id: int, payload: bytes, source: Ids, *, sequence: int = 0, flags: int = 0) -> bytes:
    """Return a MAVLink 2 frame, without the signature of flag 1."""
    header = struct.pack("<BBBBBB", len(payload), flags, 0, sequence, *source) + message_id.to_bytes(3, "little")
    return b"\xfd" + header + payload + _crc(header + payload, message_id)


def frame_v1(message_id: int, payload: bytes, source: Ids) -> bytes:
    body = struct.pack("<BBBBB", len(payload), 0, *source, message_id) + payload
    return b"\xfe" + body + _crc(body, message_id)


def payload_size(message_id: int) -> int:
    return int(common.mavlink_map[message_id].unpacker.size)


def _crc(content: bytes, message_id: int) -> bytes:
    known = common.mavlink_map.get(message_id)
    extra = known.crc_extra if known else _CRC_EXTRA_OF_THE_UNKNOWN
    return struct.pack("<H", common.x25crc(bytearray(content) + bytes([extra])).crc)


FRAME_US = 100_000  # interval of the flight under fire

_CONVERSATION = (HEARTBEAT, ATTITUDE, POSITION, COMMAND, ACK, ACTUATORS)
_SET_MESSAGE_INTERVAL = 511
_NOT_FINITE = (nan, inf, -inf)
_EXTREME = (3.4e38, -3.4e38, 1e-45, -0.0)
_QUATERNIONS = ((1.0, 0.0, 0.0, 0.0), (0.5, 0.5, 0.5, 0.5), (0.0, 0.6, 0.8, 0.0))


class Fuzzer:
    """Datagrams for one `receiver`, in the name of its `peer`."""

    def __init__(self, chance: random.Random, peer: Ids, receiver: Ids) -> None:
        self._chance = chance
        self._peer = peer
        self._receiver = receiver
        self.moment_us = FRAME_US  # of the flight: broken messages carry it, valid ones never do
        self.good = frame(HEARTBEAT, bytes(9), peer)  # to be corrupted
        self._attitude_is_broken = True
        self._kinds: tuple[Callable[[], bytes], ...] = (
            self._any_message,
            self._wrong_length,
            self._unknown_id,
            self._foreign,
            self._state,
            self._actuators,
            self._command,
            self._ack,
            self._flagged,
            self._version_1,
        )

    def random(self) -> bytes:
        chance = self._chance
        kind = chance.randrange(4)
        if kind == 0:
            return chance.randbytes(chance.randrange(601))
        if kind == 1:
            return chance.choice((b"\xfd", b"\xfe")) + chance.randbytes(chance.randrange(300))
        spoilt = bytearray(chance.choice((self.good, self.hostile())))
        if kind == 2:
            return bytes(spoilt[: chance.randrange(len(spoilt))])
        spoilt[chance.randrange(len(spoilt))] ^= chance.randrange(1, 256)
        return bytes(spoilt)

    def hostile(self) -> bytes:
        """Return up to three frames with wrong contents."""
        # The same half all along a datagram: a receiver takes the last of each, and two good ones would be a frame.
        self._attitude_is_broken = self._chance.random() < 0.5
        return b"".join(self._chance.choice(self._kinds)() for _ in range(self._chance.choice((1, 1, 1, 2, 3))))

    def _any_message(self) -> bytes:
        message_id = self._chance.choice((self._chance.choice(KNOWN), self._chance.choice(_CONVERSATION)))
        payload = self._chance.randbytes(payload_size(message_id))
        return frame(message_id, payload, self._peer, sequence=self._chance.randrange(256))

    def _wrong_length(self) -> bytes:
        """Return a message that is cut short or too long."""
        length = self._chance.choice((0, 1, self._chance.randrange(2, 12), self._chance.randrange(256), 255))
        payload = self._chance.choice((b"\xff" * length, self._chance.randbytes(length)))
        return frame(self._chance.choice(_CONVERSATION), payload, self._peer)

    def _unknown_id(self) -> bytes:
        message_id = self._chance.choice((MAX_MESSAGE_ID, self._chance.randrange(60_000, MAX_MESSAGE_ID)))
        return frame(message_id, self._chance.randbytes(self._chance.randrange(256)), self._peer)

    def _foreign(self) -> bytes:
        """Return a plausible message of the peer from another source."""
        source = self._chance.choice(((2, self._peer[1]), (self._peer[0], 77), self._receiver, (255, 190), (0, 0)))
        return self._valid_state(self.moment_us, source) + self._valid_actuators(self.moment_us, source)

    def _state(self) -> bytes:
        """Return a frame with a broken or missing half, or out of step."""
        kind = self._chance.randrange(3)
        if kind == 0:
            return self._valid_state(self._another_moment_us(), self._peer)
        values = [self._value() for _ in range(13)]
        if kind == 1:
            values[:4] = self._chance.choice(_QUATERNIONS)
        broken = range(7) if self._attitude_is_broken else range(7, 13)
        values[self._chance.choice(broken)] = self._chance.choice(_NOT_FINITE)
        time_ms = self.moment_us // 1000
        attitude = frame(ATTITUDE, pack("<I7f", time_ms, *values[:7]), self._peer)
        position = frame(POSITION, pack("<I6f", time_ms + self._chance.choice((0, 0, 1)), *values[7:]), self._peer)
        return self._chance.choice((attitude + position, position + attitude, attitude, position))

    def _actuators(self) -> bytes:
        """Return an impossible control, or one for another moment."""
        if self._chance.random() < 0.5:
            return self._valid_actuators(self._another_moment_us(), self._peer)
        controls = [self._chance.random() for _ in range(16)]
        controls[self._chance.randrange(4)] = self._chance.choice((*_NOT_FINITE, *_EXTREME[:2], -1.0, 1.5))
        return frame(ACTUATORS, pack("<QQ16fB", self.moment_us, 1, *controls, 0xFF), self._peer)

    def _command(self) -> bytes:
        command = self._chance.choice((_SET_MESSAGE_INTERVAL, 400, self._chance.randrange(65536)))
        message_id = self._chance.choice((float(ATTITUDE), self._value()))
        interval_us = self._chance.choice((1000.0, 50_000.0, 1e6, self._value()))
        rest = [self._value() for _ in range(5)]
        target = self._chance.choice((self._receiver, (0, 0), (9, 9)))
        payload = pack("<7fHBBB", message_id, interval_us, *rest, command, *target, self._chance.randrange(256))
        return frame(COMMAND, payload, self._peer)

    def _ack(self) -> bytes:
        command = self._chance.choice((_SET_MESSAGE_INTERVAL, self._chance.randrange(65536)))
        return frame(ACK, pack("<H", command) + self._chance.randbytes(8), self._peer)

    def _flagged(self) -> bytes:
        """Return a frame with a random signature or unknown flags."""
        flags = self._chance.choice((1, 1, 1, self._chance.randrange(2, 256)))
        signature = self._chance.randbytes(13) if flags & 1 else b""
        time_us = self._another_moment_us()
        payload = self._actuators_payload(time_us)
        return frame(ACTUATORS, payload, self._peer, flags=flags) + signature

    def _version_1(self) -> bytes:
        message_id = self._chance.choice(_CONVERSATION)
        if message_id == ACTUATORS:
            return frame_v1(message_id, self._actuators_payload(self._another_moment_us()), self._peer)
        return frame_v1(message_id, self._chance.randbytes(payload_size(message_id)), self._peer)

    def _another_moment_us(self) -> int:
        """Return a moment that is not awaited."""
        chance = self._chance
        past = self.moment_us - FRAME_US * chance.randrange(1, 100)
        future = self.moment_us + FRAME_US * chance.randrange(10, 1000)
        between = self.moment_us + 1000 * chance.randrange(1, FRAME_US // 1000)
        return chance.choice((past if past > 0 else future, future, between))

    def _valid_state(self, time_us: int, source: Ids) -> bytes:
        attitude = pack("<I7f", time_us // 1000, *self._chance.choice(_QUATERNIONS), 0.0, 0.0, 0.0)
        position = pack("<I6f", time_us // 1000, *(self._chance.gauss(0.0, 10.0) for _ in range(6)))
        return frame(ATTITUDE, attitude, source) + frame(POSITION, position, source)

    def _valid_actuators(self, time_us: int, source: Ids) -> bytes:
        return frame(ACTUATORS, self._actuators_payload(time_us), source)

    def _actuators_payload(self, time_us: int) -> bytes:
        controls = [self._chance.random() for _ in range(16)]
        return pack("<QQ16fB", time_us, 1, *controls, self._chance.choice((0x00, 0x80)))

    def _value(self) -> float:
        chance = self._chance
        return chance.choice((*_NOT_FINITE, *_EXTREME, 0.0, chance.gauss(0.0, 1e5), chance.random()))
