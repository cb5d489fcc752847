"""Bytes ⇄ MAVLink 2 messages; the one place that knows pymavlink. Nothing malformed ever raises: it is counted."""

from collections import Counter, namedtuple
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from operator import itemgetter
from struct import Struct
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import development

from mavlink.extensions import with_later_fields

mav: Any = development
"""The dialect: its enumerations, for who speaks it."""

AUTOPILOT_COMPONENT: int = mav.MAV_COMP_ID_AUTOPILOT1
PLANT_COMPONENT: int = mav.MAV_COMP_ID_USER1

TYPE_QUADROTOR: int = mav.MAV_TYPE_QUADROTOR
TYPE_GENERIC: int = mav.MAV_TYPE_GENERIC
AUTOPILOT_GENERIC: int = mav.MAV_AUTOPILOT_GENERIC
AUTOPILOT_INVALID: int = mav.MAV_AUTOPILOT_INVALID
STATE_ACTIVE: int = mav.MAV_STATE_ACTIVE
MODE_ARMED: int = mav.MAV_MODE_FLAG_SAFETY_ARMED
MODE_CUSTOM: int = mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
MODE_HIL: int = mav.MAV_MODE_FLAG_HIL_ENABLED
CMD_SET_MESSAGE_INTERVAL: int = mav.MAV_CMD_SET_MESSAGE_INTERVAL
MSG_ATTITUDE_QUATERNION: int = mav.MAVLINK_MSG_ID_ATTITUDE_QUATERNION
RESULT_ACCEPTED: int = mav.MAV_RESULT_ACCEPTED
RESULT_TEMPORARILY_REJECTED: int = mav.MAV_RESULT_TEMPORARILY_REJECTED
RESULT_DENIED: int = mav.MAV_RESULT_DENIED
RESULT_UNSUPPORTED: int = mav.MAV_RESULT_UNSUPPORTED

_HEADER_AND_CRC_V1 = mav.HEADER_LEN_V1 + 2
_MARKER = 0xFD
_HEADER = Struct("<BBBBBBBHB")
"""Marker, payload length, two flags, sequence, system, component, message id (its low 16 bits, its high 8)."""
_CRC_BYTES = 2
_CRC_START = 0xFFFF


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

    Whole MAVLink 2 frames whose fields are numbers, which is all that a flight sends, are read and written here:
    pymavlink takes several times as long. Everything else is left to pymavlink, as is every judgement on bad input.

    Attributes:
        dropped: How many pieces of input were no message of this dialect, by reason.
    """

    def __init__(self, system_id: int, component_id: int) -> None:
        """Speak as component `component_id` of system `system_id`."""
        self._mav = mav.MAVLink(None, srcSystem=system_id, srcComponent=component_id)
        self._mav.robust_parsing = True
        self.source = (system_id, component_id)
        self.dropped: Counter[str] = Counter()

    def encode(self, name: str, *fields: Any) -> bytes:
        """Encode message `name` with its fields in the order of the MAVLink definition, in wire units and frames."""
        layout = _layout_named(name)
        if layout is None:
            frame = bytes(_message_named(name)(*fields).pack(self._mav))
        else:
            frame = layout.frame(fields, self._mav.seq, self.source)
        self._mav.seq = (self._mav.seq + 1) % 256
        return frame

    def decode(self, datagram: bytes) -> list[Message]:
        """Return the messages of one datagram. A datagram holds whole frames: none continues the one before."""
        messages = _whole_messages(datagram)
        return self._parsed(datagram) if messages is None else messages

    def _parsed(self, datagram: bytes) -> list[Message]:
        """Return what pymavlink makes of a datagram; count what it cannot."""
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


class _Layout:
    """How a message whose fields are all numbers lies in a frame.

    Attributes:
        name: Message name.
    """

    def __init__(self, definition: Any) -> None:
        """Take the layout from pymavlink's class of the message."""
        definition = with_later_fields(definition)
        self.name: str = definition.msgname
        self._id: int = definition.id
        self._payload: Struct = definition.unpacker
        self._crc_extra = bytes([definition.crc_extra])
        self._fields: Any = namedtuple("_fields", definition.fieldnames)  # type: ignore[misc]
        self._defaults: tuple[Any, ...] = definition.__init__.__defaults__ or ()
        places = dict(zip(definition.ordered_fieldnames, _places(definition.array_lengths), strict=True))
        self._in_order_of_fields = _getter([places[name] for name in definition.fieldnames])
        self._in_order_of_wire = _getter([definition.fieldnames.index(name) for name in definition.ordered_fieldnames])
        self._lengths: list[int] | None = definition.array_lengths if any(definition.array_lengths) else None

    def frame(self, fields: Sequence[Any], sequence: int, source: tuple[int, int]) -> bytes:
        """Return the whole frame; fields of extensions may be missing, zeros at the end of the payload are left out."""
        missing = len(self._fields._fields) - len(fields)
        if missing:
            fields = (*fields, *self._defaults[-missing:])
        values = self._in_order_of_wire(fields)
        if self._lengths is not None:
            values = _flat(values, self._lengths)
        payload = self._payload.pack(*values).rstrip(b"\0") or b"\0"
        header = _HEADER.pack(_MARKER, len(payload), 0, 0, sequence, *source, self._id & 0xFFFF, self._id >> 16)
        frame = header + payload
        return frame + self.crc(frame)

    def crc(self, header_and_payload: bytes) -> bytes:
        """Return the checksum behind a header and a payload."""
        return _crc16(header_and_payload[1:] + self._crc_extra, _CRC_START).to_bytes(_CRC_BYTES, "little")

    def read(self, payload: bytes) -> Any:
        """Return the fields of a payload, of which zeros at the end, and what a later dialect added, may be missing."""
        size = self._payload.size
        return self._fields._make(self._in_order_of_fields(self._payload.unpack(payload.ljust(size, b"\0")[:size])))


def _whole_messages(datagram: bytes) -> list[Message] | None:
    """Return the messages of a datagram made of nothing but whole frames of numbers; None for any other."""
    messages, end, after = [], len(datagram), 0
    while after < end:
        at = after
        if end - at < _HEADER.size:
            return None
        marker, length, incompatible, _, _, system, component, low, high = _HEADER.unpack_from(datagram, at)
        after = at + _HEADER.size + length + _CRC_BYTES
        if marker != _MARKER or incompatible or after > end:
            return None
        layout = _layout(low | high << 16)
        frame = datagram[at:after]
        if layout is None or layout.crc(frame[:-_CRC_BYTES]) != frame[-_CRC_BYTES:]:
            return None
        fields = layout.read(frame[_HEADER.size : -_CRC_BYTES])
        messages.append(Message(layout.name, (system, component), fields, frame))
    return messages


def _slow_crc16(data: bytes, _start: int) -> int:
    crc: int = mav.x25crc(data).crc
    return crc


_crc16: Callable[[bytes, int], int] = getattr(mav, "mcrf4xx", None) or _slow_crc16
"""The compiled checksum that pymavlink found, without the object that it puts around it."""


def _message_named(name: str) -> Any:
    return getattr(mav, f"MAVLink_{name.lower()}_message")


@cache
def _layout_named(name: str) -> _Layout | None:
    return _layout(_message_named(name).id)


@cache
def _layout(message_id: int) -> _Layout | None:
    """Return the layout of a message; None where the dialect has none, or some of its fields are text."""
    definition = mav.mavlink_map.get(message_id)
    if definition is None or "char" in definition.fieldtypes:
        return None
    return _Layout(definition)


def _places(lengths: Sequence[int]) -> Iterator[int | slice]:
    """Yield where each field's number, or numbers where it has a length, are among all of a payload's."""
    at = 0
    for length in lengths:
        yield slice(at, at + length) if length else at
        at += length or 1


def _getter(places: Sequence[int | slice]) -> Callable[[Sequence[Any]], Sequence[Any]]:
    """Return what reads several places of a sequence, as a sequence even if it is one place."""
    if len(places) == 1:
        return lambda values: (values[places[0]],)
    return itemgetter(*places)


def _flat(values: Sequence[Any], lengths: Sequence[int]) -> list[Any]:
    """Return the numbers of all fields; those with a length are arrays."""
    flat: list[Any] = []
    for value, length in zip(values, lengths, strict=True):
        if length:
            flat.extend(value[:length])
        else:
            flat.append(value)
    return flat
