"""Bytes ⇄ MAVLink 2 messages, and the only import of pymavlink. Malformed input is counted, never raised."""

from collections import Counter, namedtuple
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from operator import itemgetter
from struct import Struct
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import development

from colibri.common.records import Record
from colibri.mavlink.wire import missing_messages

missing_messages.add_to(development)
mav: Any = development  # the dialect with its enumerations

AUTOPILOT_COMPONENT: int = mav.MAV_COMP_ID_AUTOPILOT1
PLANT_COMPONENT: int = mav.MAV_COMP_ID_USER1
TRUTH_COMPONENT: int = mav.MAV_COMP_ID_USER2  # sends the true state, for programs between plant and autopilot

TYPE_QUADROTOR: int = mav.MAV_TYPE_QUADROTOR
_TYPES = {3: mav.MAV_TYPE_TRICOPTER, 4: TYPE_QUADROTOR, 6: mav.MAV_TYPE_HEXAROTOR, 8: mav.MAV_TYPE_OCTOROTOR}
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

MARKER = 0xFD  # first byte of a MAVLink 2 frame
SIGNED = 0x01  # incompatibility flag of a signed frame, https://mavlink.io/en/guide/serialization.html
SIGNATURE_BYTES: int = mav.MAVLINK_SIGNATURE_BLOCK_LEN
UNKNOWN = "UNKNOWN"  # name of messages outside the dialect

_HEADER = Struct("<BBBBBBBHB")  # marker, length, two flags, sequence, system, component, id (low 16 bits, high 8)
HEADER_BYTES = _HEADER.size
_MARKER = bytes([MARKER])
_HEADER_BYTES_V1: int = mav.HEADER_LEN_V1
_PARAM_VALUE = Struct("<I")
CRC_BYTES = 2
CRC_START = 0xFFFF


def rotors_of(vehicle_type: int) -> int | None:
    """Return how many rotors a MAV_TYPE has, if it is known."""
    return next((rotors for rotors, kind in _TYPES.items() if kind == vehicle_type), None)


def vehicle_type(rotors: int) -> int:
    """Return the MAV_TYPE of a multirotor."""
    return int(_TYPES.get(rotors, mav.MAV_TYPE_GENERIC_MULTIROTOR))


def bits(prefix: str, names: str) -> int:
    """Return the sum of enumeration members `prefix` + name, for names separated by spaces."""
    return sum(getattr(mav, prefix + name) for name in names.split())


class Refusal(NamedTuple):
    """A refusal of a request; the reason is empty if the result suffices."""

    reason: str = ""
    result: int = RESULT_DENIED  # MAV_RESULT


class Message(Record, frozen=True):
    """A decoded message with a valid CRC; its values are unchecked."""

    name: str
    source: tuple[int, int]  # system and component id
    fields: Any  # attributes, in wire units and frames
    frame: bytes  # received bytes with signature


class Bits(NamedTuple):
    """The bits of a float field: Python changes a signalling NaN."""

    pattern: int


def param_bits(message: Message) -> int:
    """Return the bits of `param_value`, where an integer's may be a signalling NaN."""
    return int.from_bytes(payload(message.frame)[: _PARAM_VALUE.size], "little")


def payload(frame: bytes) -> bytes:
    """Return the payload, possibly without trailing zeros, of a frame."""
    start = _header_bytes(frame)
    return frame[start : start + frame[1]]


def sequence_of(frame: bytes) -> int:
    return frame[4] if frame[0] == MARKER else frame[2]


def intact(frame: bytes) -> bool | None:
    """Whether a frame's CRC holds; `None` for a message outside the dialect."""
    start = _header_bytes(frame)
    layout = _layout(int.from_bytes(frame[7:start], "little") if start == HEADER_BYTES else frame[start - 1])
    if layout is None:
        return None
    end = start + frame[1]
    return layout.crc(frame[:end]) == frame[end : end + CRC_BYTES]


class Codec:
    """Encoder for one component, decoder for any, several times as fast as pymavlink; signatures are not checked."""

    def __init__(self, system_id: int, component_id: int, *, keep_unknown: bool = False) -> None:
        self._mav = mav.MAVLink(None, srcSystem=system_id, srcComponent=component_id)
        self._mav.robust_parsing = True
        self._sequence = 0
        self._keep_unknown = keep_unknown
        self.source = (system_id, component_id)  # own system and component id
        self._source_bytes = bytes(self.source)
        self.seal: Callable[[bytes], bytes] | None = None  # signs a frame
        self.dropped: Counter[str] = Counter()  # invalid input, by reason

    def encode(self, name: str, *fields: Any) -> bytes:
        """Encode a message with fields in MAVLink's order and wire units; text is cut, `param_value` may be `Bits`."""
        layout = _layout_named(name)
        return self.framed(layout.payload(fields), layout.message_id, layout.crc_extra)

    def framed(self, payload: bytes, message_id: bytes, crc_extra: bytes) -> bytes:
        if not payload[-1]:
            payload = payload.rstrip(b"\0") or b"\0"
        sequence, seal = self._sequence, self.seal
        self._sequence = (sequence + 1) % 256
        flags = 0 if seal is None else SIGNED
        covered = bytes((len(payload), flags, 0, sequence)) + self._source_bytes + message_id + payload
        frame = _MARKER + covered + crc16(covered + crc_extra, CRC_START).to_bytes(CRC_BYTES, "little")
        return frame if seal is None else frame + seal(frame)

    def next_sequence(self) -> int:
        """Return the sequence number of the next frame, and count on."""
        sequence = self._sequence
        self._sequence = (sequence + 1) % 256
        return sequence

    def skip(self, frames: int) -> None:
        """Leave out the sequence numbers of frames."""
        self._sequence = (self._sequence + frames) % 256

    def decode(self, datagram: bytes) -> list[Message]:
        messages = _whole_messages(datagram)
        return self._parsed(datagram) if messages is None else messages

    def _parsed(self, datagram: bytes) -> list[Message]:
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
    def __init__(self, definition: Any) -> None:
        self.name: str = definition.msgname
        later = [name for name in missing_messages.LATER.get(self.name, ()) if name not in definition.fieldnames]
        names, names_on_wire = [*definition.fieldnames, *later], [*definition.ordered_fieldnames, *later]
        kinds = [*definition.fieldtypes, *["uint32_t"] * len(later)]
        array_lengths = [*definition.array_lengths, *[0] * len(later)]
        packing = Struct(definition.unpacker.format + "I" * len(later))
        self.message_id: bytes = definition.id.to_bytes(3, "little")
        self.crc_extra = bytes([definition.crc_extra])
        self._size, self._unpack = packing.size, packing.unpack
        self._pack: Callable[..., bytes] = packing.pack
        self._fields: Any = namedtuple("_fields", names)  # type: ignore[misc]
        self._defaults: tuple[Any, ...] = (*(definition.__init__.__defaults__ or ()), *[0] * len(later))
        order = [names.index(name) for name in names_on_wire]
        lengths = [0 if kinds[i] == "char" else n for i, n in zip(order, array_lengths, strict=True)]
        places = dict(zip(names_on_wire, _places(lengths), strict=True))
        self._in_order_of_fields = _getter([places[name] for name in names])
        self._in_order_of_wire = _getter(order)
        self._lengths: list[int] | None = lengths if any(lengths) else None
        self._texts = [i for i, kind in enumerate(kinds) if kind == "char"]

    def payload(self, fields: Sequence[Any]) -> bytes:
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
        return crc16(header_and_payload[1:] + self.crc_extra, CRC_START).to_bytes(CRC_BYTES, "little")

    def read(self, payload: bytes) -> Any:
        size = self._size
        values = self._in_order_of_fields(self._unpack(payload.ljust(size, b"\0")[:size]))
        return self._fields._make(self._with_text(values) if self._texts else values)

    def _with_text(self, values: Sequence[Any]) -> list[Any]:
        """Return the fields with text up to the first NUL, non-ASCII replaced."""
        fields = list(values)
        for i in self._texts:
            fields[i] = fields[i].split(b"\0", 1)[0].decode("ascii", "replace")
        return fields


class _ParameterLayout(_Layout):
    """Layout of PARAM_VALUE and PARAM_SET: their float is first on the wire and may be `Bits`."""

    def __init__(self, definition: Any) -> None:
        super().__init__(definition)
        self._pack_floats = self._pack
        self._pack = self._pack_bits_or_floats

    def _pack_bits_or_floats(self, value: Any, *others: Any) -> bytes:
        if not isinstance(value, Bits):
            return self._pack_floats(value, *others)
        return _PARAM_VALUE.pack(value.pattern) + self._pack_floats(0.0, *others)[_PARAM_VALUE.size :]


def _whole_messages(datagram: bytes) -> list[Message] | None:
    """Return the messages of a datagram of whole MAVLink 2 frames; `None` for any other."""
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


crc16: Callable[[bytes, int], int] = getattr(mav, "mcrf4xx", None) or (lambda data, _start: mav.x25crc(data).crc)
"""pymavlink's compiled checksum without its wrapper object."""


def definition_of(name: str) -> Any:
    return getattr(mav, f"MAVLink_{name.lower()}_message")


@cache
def _layout_named(name: str) -> _Layout:
    return (_ParameterLayout if name in ("PARAM_VALUE", "PARAM_SET") else _Layout)(definition_of(name))


def _layout(message_id: int) -> _Layout | None:
    """Return the layout of a message; unknown ids are not cached."""
    definition = mav.mavlink_map.get(message_id)
    return None if definition is None else _layout_named(definition.msgname)


def _places(lengths: Sequence[int]) -> Iterator[int | slice]:
    at = 0
    for length in lengths:
        yield slice(at, at + length) if length else at
        at += length or 1


def _getter(places: Sequence[int | slice]) -> Callable[[Sequence[Any]], Sequence[Any]]:
    if len(places) == 1:
        return lambda values: (values[places[0]],)
    return itemgetter(*places)


def _flat(values: Sequence[Any], lengths: Sequence[int]) -> list[Any]:
    flat: list[Any] = []
    for value, length in zip(values, lengths, strict=True):
        if length:
            flat.extend(value[:length])
        else:
            flat.append(value)
    return flat
