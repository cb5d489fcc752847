"""Splitting of a byte stream into MAVLink frames."""

import re

from colibri.mavlink.wire.dialect import MARKER, SIGNATURE_BYTES, SIGNED, intact

_MARKERS = re.compile(b"[\xfd\xfe]")
_MARKER_V1 = 0xFE
_PREFIX_BYTES = 3  # determine a frame's length: marker, payload length, incompatibility flags (of MAVLink 2)
_OTHER_BYTES_V1 = 8
_OTHER_BYTES = 12


class Framer:
    """Splitter of a stream into frames with valid CRC. With unknown CRC, another frame or silence must follow."""

    def __init__(self) -> None:
        self._rest = b""

    def take(self, chunk: bytes) -> list[bytes]:
        frames: list[bytes] = []
        data, at = self._rest + chunk, 0
        while marker := _MARKERS.search(data, at):
            at = marker.start()
            length = frame_length(data, at)
            if length is None or at + length > len(data):
                self._rest = data[at:]
                return frames
            if length and _is_frame(data, at, at + length):
                frames.append(data[at : at + length])
                at += length
            else:
                at += 1
        self._rest = b""
        return frames


def frame_length(data: bytes, at: int) -> int | None:
    """Return the length of a frame at `at`; 0 if impossible, `None` if more bytes are needed."""
    if at + _PREFIX_BYTES > len(data):
        return None
    marker, payload_bytes, incompatible = data[at : at + _PREFIX_BYTES]
    if marker == _MARKER_V1:
        return _OTHER_BYTES_V1 + payload_bytes
    if marker != MARKER:
        return 0
    if incompatible not in (0, SIGNED):
        return 0
    return _OTHER_BYTES + payload_bytes + (SIGNATURE_BYTES if incompatible else 0)


def _is_frame(data: bytes, at: int, end: int) -> bool:
    known = intact(data[at:end])
    if known is None:
        return end == len(data) or _MARKERS.match(data, end) is not None
    return known
