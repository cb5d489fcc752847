"""The messages of a ULog file: https://docs.px4.io/main/en/dev_log/ulog_file_format."""

from collections.abc import Mapping
from struct import Struct

MAGIC = b"ULog\x01\x12\x35"
_VERSION = 1
_HEAD = Struct("<HB")
_SUBSCRIPTION = Struct("<BH")
_LOGGED = Struct("<BQ")
_TYPES = {int: ("int32_t", Struct("<i")), float: ("float", Struct("<f"))}
_MAX_TEXT_BYTES = 1000

DATA, FORMAT = ord("D"), ord("F")
HEADER_BYTES = len(MAGIC) + 1 + 8  # of the file, before its first message
HEAD_BYTES = _HEAD.size


def message(kind: str, content: bytes) -> bytes:
    return _HEAD.pack(len(content), ord(kind)) + content


SYNC = message("S", bytes([0x2F, 0x73, 0x13, 0x20, 0x25, 0x0C, 0xBB, 0x12]))  # readers find it after unreadable bytes


def header() -> bytes:
    return MAGIC + bytes([_VERSION]) + bytes(8) + message("B", bytes(8 + 8 + 3 * 8))


def format_of(name: str, fields: str) -> bytes:
    return message("F", f"{name}:{fields}".encode())


def information(facts: Mapping[str, str]) -> bytes:
    texts = {name: fact.encode() for name, fact in facts.items()}
    return b"".join(_keyed("I", f"char[{len(text)}] {name}", text) for name, text in texts.items())


def parameters(values: Mapping[str, int | float]) -> bytes:
    encoded = b""
    for name, value in values.items():
        kind, layout = _TYPES[type(value)]
        encoded += _keyed("P", f"{kind} {name}", layout.pack(value))
    return encoded


def _keyed(kind: str, key: str, value: bytes) -> bytes:
    return message(kind, bytes([len(key)]) + key.encode() + value)


def subscription(topic: str, number: int) -> bytes:
    return message("A", _SUBSCRIPTION.pack(0, number) + topic.encode())


def logged_string(time_us: int, severity: int, text: str) -> bytes:
    return message("L", _LOGGED.pack(ord("0") + severity, time_us) + text.encode()[:_MAX_TEXT_BYTES])
