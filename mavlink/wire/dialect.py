"""Bytes ⇄ MAVLink 2 messages; the one place that imports pymavlink. Nothing malformed ever raises: it is counted."""

from collections import Counter, namedtuple
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from operator import itemgetter
from struct import Struct
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import development

from colibri.mavlink.wire import missing_messages

missing_messages.add_to(development)
mav: Any = development
"""The dialect: its enumerations, for who speaks it."""

AUTOPILOT_COMPONENT: int = mav.MAV_COMP_ID_AUTOPILOT1
PLANT_COMPONENT: int = mav.MAV_COMP_ID_USER1
TRUTH_COMPONENT: int = mav.MAV_COMP_ID_USER2
"""Sends the true state, for whoever stands between plant and autopilot."""

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
MSG_HIL_SENSOR: int = mav.MAVLINK_MSG_ID_HIL_SENSOR
MSG_HIL_STATE_QUATERNION: int = mav.MAVLINK_MSG_ID_HIL_STATE_QUATERNION
RESULT_ACCEPTED: int = mav.MAV_RESULT_ACCEPTED
RESULT_TEMPORARILY_REJECTED: int = mav.MAV_RESULT_TEMPORARILY_REJECTED
RESULT_DENIED: int = mav.MAV_RESULT_DENIED
RESULT_UNSUPPORTED: int = mav.MAV_RESULT_UNSUPPORTED

MARKER = 0xFD
"""What a frame of MAVLink 2 begins with."""
SIGNED = 0x01
"""The incompatibility flag of a frame that a signature follows, https://mavlink.io/en/guide/serialization.html."""
SIGNATURE_BYTES: int = mav.MAVLINK_SIGNATURE_BLOCK_LEN
UNKNOWN = "UNKNOWN"
"""Name of a message that the dialect has not."""

_HEADER = Struct("<BBBBBBBHB")
"""Marker, payload length, two flags, sequence, system, component, message id (its low 16 bits, its high 8)."""
HEADER_BYTES = _HEADER.size
_MARKER = bytes([MARKER])
_HEADER_BYTES_V1: int = mav.HEADER_LEN_V1
_PARAM_VALUE = Struct("<I")
CRC_BYTES = 2
CRC_START = 0xFFFF


def bits(prefix: str, names: str) -> int:
    """Return the sum of enumeration members that begin with `prefix` and go on as `names` do, parted by blanks."""
    return sum(getattr(mav, prefix + name) for name in names.split())


class Message(NamedTuple):
    """A decoded message: whose CRC holds, whose values nobody has checked yet.

    Attributes:
        name: Message name as MAVLink has it, "HEARTBEAT".
        source: System and component id of the sender.
        fields: The fields as attributes, in wire units and frames; text is a str, an array a tuple or a list.
        frame: The bytes it came in, with its signature if it has one.
    """

    name: str
    source: tuple[int, int]
    fields: Any
    frame: bytes


class Bits(NamedTuple):
    """A float field by its bits: a Python float would change those of a signalling NaN."""

    pattern: int


def param_bits(message: Message) -> int:
    """Return the 32 bits of `param_value` of a PARAM_SET or PARAM_VALUE, as an unsigned integer.

    Parameters that are integers travel bytewise in that float (https://mavlink.io/en/services/parameter.html,
    parameter encoding): its value in `message.fields` is another one where the bits are those of a signalling NaN.
    """
    return int.from_bytes(payload(message.frame)[: _PARAM_VALUE.size], "little")


def payload(frame: bytes) -> bytes:
    """Return the payload of a whole frame of MAVLink 1 or 2; zeros at its end may be missing."""
    start = _header_bytes(frame)
    return frame[start : start + frame[1]]


def sequence_of(frame: bytes) -> int:
    """Return the sequence number of a whole frame of MAVLink 1 or 2."""
    return frame[4] if frame[0] == MARKER else frame[2]


def intact(frame: bytes) -> bool | None:
    """Whether the CRC of a whole frame of MAVLink 1 or 2 holds; None where the dialect has no such message."""
    start = _header_bytes(frame)
    layout = _layout(int.from_bytes(frame[7:start], "little") if start == HEADER_BYTES else frame[start - 1])
    if layout is None:
        return None
    end = start + frame[1]
    return layout.crc(frame[:end]) == frame[end : end + CRC_BYTES]


class Codec:
    """Encodes as one component, decodes from anybody.

    Whole MAVLink 2 frames, which is all that a flight sends, are read and written here: pymavlink takes several times
    as long. MAVLink 1 is left to pymavlink, as is every judgement on bad input. Signatures are read over.

    Attributes:
        source: System and component id that it speaks as.
        seal: Returns the signature of a frame that is whole but for that; None to sign nothing.
        dropped: How many pieces of input were no message of this dialect, by reason.
    """

    def __init__(self, system_id: int, component_id: int, *, keep_unknown: bool = False) -> None:
        """Speak as component `component_id` of system `system_id`.

        With `keep_unknown`, decoding returns messages that the dialect has not, too, as their frames with no fields and
        the name `UNKNOWN`: nobody can have checked their CRC.
        """
        self._mav = mav.MAVLink(None, srcSystem=system_id, srcComponent=component_id)
        self._mav.robust_parsing = True
        self._sequence = 0
        self._keep_unknown = keep_unknown
        self.source = (system_id, component_id)
        self._source_bytes = bytes(self.source)
        self.seal: Callable[[bytes], bytes] | None = None
        self.dropped: Counter[str] = Counter()

    def encode(self, name: str, *fields: Any) -> bytes:
        """Encode message `name` with its fields in the order of the MAVLink definition, in wire units and frames.

        Text is bytes, or a str that goes out as UTF-8; what is too long is cut. `param_value` of PARAM_VALUE and of
        PARAM_SET may be `Bits`.
        """
        layout = _layout_named(name)
        return self.framed(layout.payload(fields), layout.message_id, layout.crc_extra)

    def framed(self, payload: bytes, message_id: bytes, crc_extra: bytes) -> bytes:
        """Return the next frame, with this payload; zeros at its end are left out."""
        if not payload[-1]:
            payload = payload.rstrip(b"\0") or b"\0"
        sequence, seal = self._sequence, self.seal
        self._sequence = (sequence + 1) % 256
        flags = 0 if seal is None else SIGNED
        covered = bytes((len(payload), flags, 0, sequence)) + self._source_bytes + message_id + payload
        frame = _MARKER + covered + crc16(covered + crc_extra, CRC_START).to_bytes(CRC_BYTES, "little")
        return frame if seal is None else frame + seal(frame)

    def decode(self, datagram: bytes) -> list[Message]:
        """Return the messages of one datagram. A datagram holds whole frames: none continues the one before."""
        messages = _whole_messages(datagram)
        return self._parsed(datagram) if messages is None else messages

    def _parsed(self, datagram: bytes) -> list[Message]:
        """Return what pymavlink makes of a datagram; count what it cannot."""
        self._mav.buf = bytearray()
        self._mav.buf_index = 0
        self._mav.expected_length = _HEADER_BYTES_V1 + CRC_BYTES
        decoded = self._mav.parse_buffer(datagram) or ()
        if self._mav.buf_len():
            self.dropped["truncated"] += 1
        return [message for message in map(self._checked, decoded) if message]

    def _checked(self, decoded: Any) -> Message | None:
        name = decoded.get_type()
        if name == "BAD_DATA":
            self.dropped["malformed"] += 1
            return None
        frame = bytes(decoded.get_msgbuf())
        source = (frame[5], frame[6]) if frame[0] == MARKER else (frame[3], frame[4])
        if not name.startswith("UNKNOWN_"):
            return Message(name, source, decoded, frame)
        if self._keep_unknown:
            return Message(UNKNOWN, source, None, frame)
        self.dropped["unknown"] += 1
        return None


class _Layout:
    """How a message lies in a frame."""

    def __init__(self, definition: Any) -> None:
        """Take the layout from pymavlink's class of the message."""
        definition = missing_messages.with_later_fields(definition)
        self.name: str = definition.msgname
        self.message_id: bytes = definition.id.to_bytes(3, "little")
        self.crc_extra = bytes([definition.crc_extra])
        self._size: int = definition.unpacker.size
        self._pack: Callable[..., bytes] = definition.unpacker.pack
        self._unpack: Callable[[bytes], tuple[Any, ...]] = definition.unpacker.unpack
        self._fields: Any = namedtuple("_fields", definition.fieldnames)  # type: ignore[misc]
        self._defaults: tuple[Any, ...] = definition.__init__.__defaults__ or ()
        order = [definition.fieldnames.index(name) for name in definition.ordered_fieldnames]
        kinds = [definition.fieldtypes[i] for i in order]
        lengths = [0 if kind == "char" else n for kind, n in zip(kinds, definition.array_lengths, strict=True)]
        places = dict(zip(definition.ordered_fieldnames, _places(lengths), strict=True))
        self._in_order_of_fields = _getter([places[name] for name in definition.fieldnames])
        self._in_order_of_wire = _getter(order)
        self._lengths: list[int] | None = lengths if any(lengths) else None
        self._texts = [i for i, kind in enumerate(definition.fieldtypes) if kind == "char"]

    def payload(self, fields: Sequence[Any]) -> bytes:
        """Return the payload; fields of extensions may be missing."""
        missing = len(self._fields._fields) - len(fields)
        if missing:
            fields = (*fields, *self._defaults[-missing:])
        if self._texts:
            fields = [field.encode() if isinstance(field, str) else field for field in fields]
        values = self._in_order_of_wire(fields)
        if self._lengths is not None:
            values = _flat(values, self._lengths)
        return self._pack(*values)

    def crc(self, header_and_payload: bytes) -> bytes:
        """Return the checksum behind a header and a payload."""
        return crc16(header_and_payload[1:] + self.crc_extra, CRC_START).to_bytes(CRC_BYTES, "little")

    def read(self, payload: bytes) -> Any:
        """Return the fields of a payload, of which zeros at the end, and what a later dialect added, may be missing."""
        size = self._size
        values = self._in_order_of_fields(self._unpack(payload.ljust(size, b"\0")[:size]))
        return self._fields._make(self._with_text(values) if self._texts else values)

    def _with_text(self, values: Sequence[Any]) -> list[Any]:
        """Return the fields with text as pymavlink reads it: up to the first NUL; what is not ASCII is replaced."""
        fields = list(values)
        for i in self._texts:
            fields[i] = fields[i].split(b"\0", 1)[0].decode("ascii", "replace")
        return fields


class _ParameterLayout(_Layout):
    """Of PARAM_VALUE and PARAM_SET, whose float is the first of the wire and may be `Bits`."""

    def __init__(self, definition: Any) -> None:
        """Take the layout from pymavlink's class of the message."""
        super().__init__(definition)
        self._pack_floats = self._pack
        self._pack = self._pack_bits_or_floats

    def _pack_bits_or_floats(self, value: Any, *others: Any) -> bytes:
        if not isinstance(value, Bits):
            return self._pack_floats(value, *others)
        return _PARAM_VALUE.pack(value.pattern) + self._pack_floats(0.0, *others)[_PARAM_VALUE.size :]


def _whole_messages(datagram: bytes) -> list[Message] | None:
    """Return the messages of a datagram made of nothing but whole MAVLink 2 frames; None for any other."""
    messages, end, after = [], len(datagram), 0
    while after < end:
        at = after
        if end - at < HEADER_BYTES:
            return None
        marker, length, incompatible, _, _, system, component, low, high = _HEADER.unpack_from(datagram, at)
        crc_at = at + HEADER_BYTES + length
        after = crc_at + CRC_BYTES
        if incompatible == SIGNED:
            after += SIGNATURE_BYTES
        elif incompatible:
            return None
        if marker != MARKER or after > end:
            return None
        layout = _layout(low | high << 16)
        if layout is None or layout.crc(datagram[at:crc_at]) != datagram[crc_at : crc_at + CRC_BYTES]:
            return None
        fields = layout.read(datagram[at + HEADER_BYTES : crc_at])
        messages.append(Message(layout.name, (system, component), fields, datagram[at:after]))
    return messages


def _header_bytes(frame: bytes) -> int:
    return HEADER_BYTES if frame[0] == MARKER else _HEADER_BYTES_V1


def _slow_crc16(data: bytes, _start: int) -> int:
    crc: int = mav.x25crc(data).crc
    return crc


crc16: Callable[[bytes, int], int] = getattr(mav, "mcrf4xx", None) or _slow_crc16
"""The compiled checksum that pymavlink found, without the object that it puts around it."""


def definition_of(name: str) -> Any:
    """Return pymavlink's class of a message."""
    return getattr(mav, f"MAVLink_{name.lower()}_message")


@cache
def _layout_named(name: str) -> _Layout:
    return (_ParameterLayout if name in ("PARAM_VALUE", "PARAM_SET") else _Layout)(definition_of(name))


def _layout(message_id: int) -> _Layout | None:
    """Return the layout of a message, None of an unknown one: of those, which anybody may send, none is kept."""
    definition = mav.mavlink_map.get(message_id)
    return None if definition is None else _layout_named(definition.msgname)


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
