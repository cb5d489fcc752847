"""The autopilot's input as a topic: records of any length in chunks of one size."""

from collections.abc import Iterator
from enum import IntEnum
from struct import Struct
from typing import NamedTuple

from colibri.mavlink.ulog.messages import DATA

INPUT, INPUT_NUMBER = "colibri_input", 106
CHUNK_BYTES = 88  # fits a frame of state or sensor feedback
INPUT_FIELDS = f"uint64_t timestamp;uint8_t what;bool goes_on;uint8_t size;uint8_t[{CHUNK_BYTES}] data;"
_CHUNK = Struct(f"<HQB?B{CHUNK_BYTES}s")
_MESSAGE = Struct(f"<HB{_CHUNK.format[1:]}")
CONTENT_BYTES = _CHUNK.size  # of a message without its head


class RecordKind(IntEnum):
    SETUP = 1  # the autopilot's setup, as JSON
    DATAGRAM = 2  # a ground station's datagram, as JSON
    FRAME = 3  # a datagram of the plant


class InputRecord(NamedTuple):
    time_us: int
    kind: int
    content: bytes


def encode_input(time_us: int, kind: RecordKind, content: bytes) -> bytes:
    if len(content) <= CHUNK_BYTES:
        return _MESSAGE.pack(CONTENT_BYTES, DATA, INPUT_NUMBER, time_us, kind, False, len(content), content)
    encoded = b""
    for begin in range(0, len(content), CHUNK_BYTES):
        chunk = content[begin : begin + CHUNK_BYTES]
        goes_on = begin + CHUNK_BYTES < len(content)
        encoded += _MESSAGE.pack(CONTENT_BYTES, DATA, INPUT_NUMBER, time_us, kind, goes_on, len(chunk), chunk)
    return encoded


def decode_inputs(chunks: Iterator[bytes]) -> Iterator[InputRecord]:
    """Yield the records of data messages without heads; a truncated one is omitted."""
    content = b""
    for chunk in chunks:
        _, time_us, kind, goes_on, size, data = _CHUNK.unpack(chunk)
        content += data[:size]
        if not goes_on:
            yield InputRecord(time_us, kind, content)
            content = b""
