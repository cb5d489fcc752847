"""Messages and fields of MAVLink's common set that pymavlink lacks, as its generator would define them.

Source: mavlink.io/en/messages/common.html. CRC_EXTRA follows from the definition, so a mistake makes peers drop the
message. Extension fields are not part of it: receivers cut or zero-fill them
(mavlink.io/en/guide/serialization.html#message-extensions).
"""

from re import findall
from struct import Struct
from typing import Any, NamedTuple

_SIZES = {"char": 1, "uint8_t": 1, "int8_t": 1, "uint16_t": 2, "int16_t": 2, "uint32_t": 4, "int32_t": 4}
_SIZES |= {"float": 4, "uint64_t": 8, "int64_t": 8, "double": 8}
_CODES = {"uint8_t": "B", "int8_t": "b", "uint16_t": "H", "int16_t": "h", "uint32_t": "I", "int32_t": "i"}
_CODES |= {"float": "f", "uint64_t": "Q", "int64_t": "q", "double": "d"}


class Field(NamedTuple):
    """A field of a message; `length` 0 is a scalar."""

    kind: str
    name: str
    length: int = 0


class Definition(NamedTuple):
    """A message without extension fields."""

    id: int
    name: str
    fields: tuple[Field, ...]


def _defined(number: int, name: str, fields: str) -> Definition:
    """Return a message from its fields in MAVLink's notation: "uint16_t[4] failure_flags"."""
    found = findall(r"(\w+)(?:\[(\d+)\])? (\w+)", fields)
    return Definition(number, name, tuple(Field(kind, field, int(length or 0)) for kind, length, field in found))


MISSING = (
    _defined(80, "COMMAND_CANCEL", "uint8_t target_system, uint8_t target_component, uint16_t command"),
    _defined(
        290,
        "ESC_INFO",
        "uint8_t index, uint64_t time_usec, uint16_t counter, uint8_t count, uint8_t connection_type, uint8_t info, "
        "uint16_t[4] failure_flags, uint32_t[4] error_count, int16_t[4] temperature",
    ),
    _defined(
        291,
        "ESC_STATUS",
        "uint8_t index, uint64_t time_usec, int32_t[4] rpm, float[4] voltage, float[4] current",
    ),
    _defined(397, "COMPONENT_METADATA", "uint32_t time_boot_ms, uint32_t file_crc, char[100] uri"),
)
LATER: dict[str, tuple[tuple[str, str], ...]] = {
    "MISSION_COUNT": (("opaque_id", "uint32_t"),),
    "MISSION_ACK": (("opaque_id", "uint32_t"),),
    "MISSION_CURRENT": (("mission_id", "uint32_t"), ("fence_id", "uint32_t"), ("rally_points_id", "uint32_t")),
}
"""Extension fields by message, in the order of definition and wire."""


def add_to(dialect: Any) -> None:
    """Add the missing messages to pymavlink's module `dialect`."""
    for definition in MISSING:
        if definition.id not in dialect.mavlink_map:
            kind = _class_of(definition, dialect)
            dialect.mavlink_map[definition.id] = kind
            setattr(dialect, kind.__name__, kind)
            setattr(dialect, f"MAVLINK_MSG_ID_{definition.name}", definition.id)


def _class_of(definition: Definition, dialect: Any) -> Any:
    fields = definition.fields
    names = [field.name for field in fields]
    # The wire has the largest types first, those of a size in the order of the definition.
    ordered = sorted(fields, key=lambda field: -_SIZES[field.kind])
    packing = Struct("<" + "".join(_code(field) for field in ordered))

    def initialize(self: Any, *values: Any) -> None:
        dialect.MAVLink_message.__init__(self, definition.id, definition.name)
        self._fieldnames, self._instance_field, self._instance_offset = names, None, -1
        for name, value in zip(names, values, strict=True):
            setattr(self, name, value)

    members = {
        "__init__": initialize,
        "id": definition.id,
        "msgname": definition.name,
        "fieldnames": names,
        "ordered_fieldnames": [field.name for field in ordered],
        "fieldtypes": [field.kind for field in fields],
        "fielddisplays_by_name": {},
        "fieldenums_by_name": {},
        "fieldunits_by_name": {},
        "native_format": bytearray(packing.format.encode()),
        "orders": [ordered.index(field) for field in fields],
        "lengths": [1 if field.kind == "char" else field.length or 1 for field in ordered],
        "array_lengths": [field.length for field in ordered],
        "crc_extra": _crc_extra(definition.name, ordered, dialect),
        "unpacker": packing,
        "instance_field": None,
        "instance_offset": -1,
    }
    return type(f"MAVLink_{definition.name.lower()}_message", (dialect.MAVLink_message,), members)


def _code(field: Field) -> str:
    if field.kind == "char":
        return f"{field.length}s"
    return f"{field.length or ''}{_CODES[field.kind]}"


def _crc_extra(name: str, ordered: list[Field], dialect: Any) -> int:
    data = bytearray(f"{name} ".encode())
    for field in ordered:
        data += f"{field.kind} {field.name} ".encode()
        if field.length:
            data.append(field.length)
    crc: int = dialect.x25crc(data).crc
    return (crc & 0xFF) ^ (crc >> 8)


def with_later_fields(definition: Any) -> Any:
    """Return pymavlink's class of a message with its missing extension fields."""
    later = [field for field in LATER.get(definition.msgname, ()) if field[0] not in definition.fieldnames]
    if not later:
        return definition
    names, kinds = [name for name, _ in later], [kind for _, kind in later]

    def initialize(*_: Any) -> None:
        raise TypeError("a layout only, not a message of pymavlink's")

    initialize.__defaults__ = (*(definition.__init__.__defaults__ or ()), *[0] * len(later))
    attributes = {
        "fieldnames": [*definition.fieldnames, *names],
        "ordered_fieldnames": [*definition.ordered_fieldnames, *names],
        "fieldtypes": [*definition.fieldtypes, *kinds],
        "lengths": [*definition.lengths, *[1] * len(later)],
        "array_lengths": [*definition.array_lengths, *[0] * len(later)],
        "unpacker": Struct(definition.unpacker.format + "".join(_CODES[kind] for kind in kinds)),
        "__init__": initialize,
    }
    return type(definition.__name__, (definition,), attributes)
