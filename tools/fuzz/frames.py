"""MAVLink frames by hand, around any payload."""

import struct

from pymavlink.dialects.v20 import common

Ids = tuple[int, int]

AUTOPILOT: Ids = (1, common.MAV_COMP_ID_AUTOPILOT1)
PLANT: Ids = (1, common.MAV_COMP_ID_USER1)
HEARTBEAT, ATTITUDE, POSITION, COMMAND, ACK, ACTUATORS = 0, 31, 32, 76, 77, 93
"""The messages of the conversation."""
KNOWN: tuple[int, ...] = tuple(sorted(common.mavlink_map))
MAX_MESSAGE_ID = 0xFFFFFF

_CRC_EXTRA_OF_THE_UNKNOWN = 0


def frame(message_id: int, payload: bytes, source: Ids, *, sequence: int = 0, flags: int = 0) -> bytes:
    """Return a MAVLink 2 frame with a right CRC, without the signature that flag 1 promises."""
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
