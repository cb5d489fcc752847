"""Messages and fields that pymavlink's dialect lacks. CRC_EXTRA follows from them, but not from extension fields."""

from re import findall
from struct import Struct, calcsize
from typing import Any, NamedTuple

CODES = {"uint8_t": "B", "int8_t": "b", "uint16_t": "H", "int16_t": "h", "uint32_t": "I", "int32_t": "i"}
CODES |= {"float": "f", "uint64_t": "Q", "int64_t": "q", "double": "d", "char": "s"}


class MessageField(NamedTuple):
    """A field of a message; `length` 0 is a scalar."""

    kind: str
    name: str
    length: int = 0


class Definition(NamedTuple):
    """A message without extension fields, by type: "uint8_t index; uint16_t[4] failure_flags"."""

    id: int
    name: str
    text: str

    @property
    def fields(self) -> list[MessageField]:
        rows = findall(r"(\w+)(?:\[(\d+)\])?((?: \w+)+)", self.text)
        return [MessageField(kind, name, int(length or 0)) for kind, length, names in rows for name in names.split()]


_ESC_INFO = (
    "uint8_t index; uint64_t time_usec; uint16_t counter; uint8_t count connection_type info; "
    "uint16_t[4] failure_flags; uint32_t[4] error_count; int16_t[4] temperature"
)
_SIMSTATE = "float roll pitch yaw xacc yacc zacc xgyro ygyro zgyro; int32_t lat lng"
_EKF = (
    "uint16_t flags; float velocity_variance pos_horiz_variance pos_vert_variance compass_variance terrain_alt_variance"
)
MISSING = (
    Definition(80, "COMMAND_CANCEL", "uint8_t target_system target_component; uint16_t command"),
    Definition(290, "ESC_INFO", _ESC_INFO),
    Definition(291, "ESC_STATUS", "uint8_t index; uint64_t time_usec; int32_t[4] rpm; float[4] voltage current"),
    Definition(152, "MEMINFO", "uint16_t brkval freemem"),
    Definition(163, "AHRS", "float omegaIx omegaIy omegaIz accel_weight renorm_val error_rp error_yaw"),
    Definition(164, "SIMSTATE", _SIMSTATE),
    Definition(168, "WIND", "float direction speed speed_z"),
    Definition(178, "AHRS2", "float roll pitch yaw altitude; int32_t lat lng"),
    Definition(183, "AUTOPILOT_VERSION_REQUEST", "uint8_t target_system target_component"),
    Definition(193, "EKF_STATUS_REPORT", _EKF),
    Definition(397, "COMPONENT_METADATA", "uint32_t time_boot_ms file_crc; char[100] uri"),
)
LATER = {
    "MISSION_COUNT": ("opaque_id",),
    "MISSION_ACK": ("opaque_id",),
    "MISSION_CURRENT": ("mission_id", "fence_id", "rally_points_id"),
}
"""Extension fields by message, each a uint32_t, in the order of definition and wire."""


def add_to(dialect: Any) -> None:
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
    ordered = sorted(fields, key=lambda field: -calcsize(CODES[field.kind]))
    packing = Struct("<" + "".join(f"{field.length or ''}{CODES[field.kind]}" for field in ordered))

    def initialize(self: Any, *values: Any) -> None:
        dialect.MAVLink_message.__init__(self, definition.id, definition.name)
        self._fieldnames, self._instance_offset = names, -1
        vars(self).update(zip(names, values, strict=True))

    members = {
        "__init__": initialize,
        "id": definition.id,
        "msgname": definition.name,
        "fieldnames": names,
        "ordered_fieldnames": [field.name for field in ordered],
        "fieldtypes": [field.kind for field in fields],
        "native_format": bytearray(packing.format.encode()),
        "orders": [ordered.index(field) for field in fields],
        "lengths": [1 if field.kind == "char" else field.length or 1 for field in ordered],
        "array_lengths": [field.length for field in ordered],
        "crc_extra": _crc_extra(definition.name, ordered, dialect),
        "unpacker": packing,
    }
    return type(f"MAVLink_{definition.name.lower()}_message", (dialect.MAVLink_message,), members)


def _crc_extra(name: str, ordered: list[MessageField], dialect: Any) -> int:
    data = bytearray(f"{name} ".encode())
    for field in ordered:
        data += f"{field.kind} {field.name} ".encode()
        if field.length:
            data.append(field.length)
    crc: int = dialect.x25crc(data).crc
    return (crc & 0xFF) ^ (crc >> 8)
