"""Bytes ⇄ MAVLink 2 messages; the one place that knows pymavlink. Nothing malformed ever raises: it is counted."""

from collections import Counter
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import common

AUTOPILOT_COMPONENT: int = common.MAV_COMP_ID_AUTOPILOT1
PLANT_COMPONENT: int = common.MAV_COMP_ID_USER1

TYPE_QUADROTOR: int = common.MAV_TYPE_QUADROTOR
TYPE_GENERIC: int = common.MAV_TYPE_GENERIC
AUTOPILOT_GENERIC: int = common.MAV_AUTOPILOT_GENERIC
AUTOPILOT_INVALID: int = common.MAV_AUTOPILOT_INVALID
STATE_ACTIVE: int = common.MAV_STATE_ACTIVE
MODE_ARMED: int = common.MAV_MODE_FLAG_SAFETY_ARMED
MODE_CUSTOM: int = common.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
MODE_HIL: int = common.MAV_MODE_FLAG_HIL_ENABLED
CMD_SET_MESSAGE_INTERVAL: int = common.MAV_CMD_SET_MESSAGE_INTERVAL
MSG_ATTITUDE_QUATERNION: int = common.MAVLINK_MSG_ID_ATTITUDE_QUATERNION
RESULT_ACCEPTED: int = common.MAV_RESULT_ACCEPTED
RESULT_TEMPORARILY_REJECTED: int = common.MAV_RESULT_TEMPORARILY_REJECTED
RESULT_DENIED: int = common.MAV_RESULT_DENIED
RESULT_UNSUPPORTED: int = common.MAV_RESULT_UNSUPPORTED

_HEADER_AND_CRC_V1 = common.HEADER_LEN_V1 + 2


class Message(NamedTuple):
    """A decoded message: whose CRC holds, whose values nobody has checked yet.

    Attributes:
        name: Message name as MAVLink has it, "HEARTBEAT".
        source: System and component id of the sender.
        fields: The fields as attributes, in wire units and frames.
        frame: The bytes it came in.
    """

    name: str
    source: tuple[int, int]
    fields: Any
    frame: bytes


class Codec:
    """Encodes as one component, decodes from anybody.

    Attributes:
        dropped: How many pieces of input were no message of this dialect, by reason.
    """

    def __init__(self, system_id: int, component_id: int) -> None:
        """Speak as component `component_id` of system `system_id`."""
        self._mav = common.MAVLink(None, srcSystem=system_id, srcComponent=component_id)
        self._mav.robust_parsing = True
        self.source = (system_id, component_id)
        self.dropped: Counter[str] = Counter()

    def encode(self, name: str, *fields: Any) -> bytes:
        """Encode message `name` with its fields in the order of the MAVLink definition, in wire units and frames."""
        message = getattr(common, f"MAVLink_{name.lower()}_message")(*fields)
        frame: bytes = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256
        return frame

    def decode(self, datagram: bytes) -> list[Message]:
        """Return the messages of one datagram. A datagram holds whole frames: none continues the one before."""
        self._mav.buf = bytearray()
        self._mav.buf_index = 0
        self._mav.expected_length = _HEADER_AND_CRC_V1
        decoded = self._mav.parse_buffer(datagram) or ()
        if self._mav.buf_len():
            self.dropped["truncated"] += 1
        return [message for message in map(self._checked, decoded) if message]

    def _checked(self, decoded: Any) -> Message | None:
        name = decoded.get_type()
        if name == "BAD_DATA":
            self.dropped["malformed"] += 1
            return None
        if name.startswith("UNKNOWN_"):
            self.dropped["unknown"] += 1
            return None
        source = (decoded.get_srcSystem(), decoded.get_srcComponent())
        return Message(name, source, decoded, bytes(decoded.get_msgbuf()))
