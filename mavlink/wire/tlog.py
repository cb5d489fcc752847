"""Telemetry logs of ground stations: frames, each after its time, µs, a big-endian integer."""

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from colibri.common.process.log_files import BlockLog
from colibri.common.process.shared_log import share
from colibri.mavlink.errors import MavlinkError
from colibri.mavlink.wire.framing import frame_length

STAMP = struct.Struct(">Q")
TRAFFIC = "flight.tlog"  # its name in the folder of a flight


class Logged(NamedTuple):
    """A frame of a log, at simulated or Unix time."""

    time_us: int
    frame: bytes


class TlogError(MavlinkError):
    """The file is not a telemetry log."""


def decode(log: bytes) -> Iterator[Logged]:
    """Yield the frames of a log, the last may be truncated; raise `TlogError` on a malformed one."""
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
    """A telemetry log written in blocks; a `shared` one has several writers."""

    def __init__(self, path: Path, *, shared: bool = False) -> None:
        super().__init__(path, "ab" if shared else "wb")
        if shared:
            share(self._file.fileno())

    def write(self, time_us: int, frames: list[bytes]) -> None:
        if frames:
            stamp = STAMP.pack(time_us)
            self.add(stamp + stamp.join(frames))
