"""Telemetry logs as ground stations write them: each frame behind its time, µs, as a big-endian integer."""

import struct
from collections.abc import Iterator
from typing import NamedTuple

from colibri.common.process.log_files import BlockLog
from colibri.mavlink.errors import MavlinkError
from colibri.mavlink.wire.framing import frame_length

STAMP = struct.Struct(">Q")


class Logged(NamedTuple):
    """A frame of a log; the time of a flight's log is simulated, or Unix time where it was dated."""

    time_us: int
    frame: bytes


class TlogError(MavlinkError):
    """What is no telemetry log; the message has the byte where it ceases to be one."""


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


class TlogWriter(BlockLog):
    """A telemetry log that is written block by block."""

    def write(self, time_us: int, frames: list[bytes]) -> None:
        """Append frames, all of time `time_us`.

        Raises:
            LogError: They cannot be written.
        """
        if frames:
            stamp = STAMP.pack(time_us)
            self.add(stamp + stamp.join(frames))
