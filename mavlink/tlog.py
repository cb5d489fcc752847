"""Telemetry logs as ground stations write them: each frame behind its time, µs, as a big-endian integer."""

import struct
from collections.abc import Iterator
from typing import NamedTuple

from mavlink.framing import frame_length

STAMP = struct.Struct(">Q")


class Logged(NamedTuple):
    """A frame of a log.

    Attributes:
        time_us: When, µs; of a flight's log simulated time.
        frame: The bytes.
    """

    time_us: int
    frame: bytes


class TlogError(Exception):
    """What is no telemetry log; the message says where it ceases to be one."""


def decode(log: bytes) -> Iterator[Logged]:
    """Yield the frames of a log; of a process that was killed, the last may be cut off.

    Raises:
        TlogError: This is no log.
    """
    at = 0
    while at + STAMP.size < len(log):
        begin = at + STAMP.size
        length = frame_length(log, begin)
        if length == 0:
            raise TlogError(f"no MAVLink frame at byte {begin}")
        if length is None or begin + length > len(log):
            return
        yield Logged(STAMP.unpack_from(log, at)[0], log[begin : begin + length])
        at = begin + length
