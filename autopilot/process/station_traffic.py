"""The traffic of ground stations in `flight.tlog`, which the plant writes, too."""

from collections.abc import Iterable, Iterator
from pathlib import Path

from colibri.mavlink.wire.dialect import mav
from colibri.mavlink.wire.framing import frame_length
from colibri.mavlink.wire.tlog import TRAFFIC, TlogWriter

MAX_BYTES = 256 << 20  # a flood of a station must not fill the disk
_KEY = mav.MAVLINK_MSG_ID_SETUP_SIGNING.to_bytes(3, "little")
_IDENTIFIER = slice(7, 10)


class StationTraffic:
    """Appends frames in both directions, except for those with a signing key."""

    def __init__(self, folder: Path, boot_unix_us: int) -> None:
        self._log = TlogWriter(folder / TRAFFIC, shared=True)
        self._boot_unix_us = boot_unix_us
        self._bytes = 0

    def write(self, time_us: int, datagrams: Iterable[bytes]) -> None:
        frames = [frame for datagram in datagrams for frame in _frames(datagram) if frame[_IDENTIFIER] != _KEY]
        self._bytes += sum(map(len, frames))
        if self._bytes <= MAX_BYTES:
            self._log.write(self._boot_unix_us + time_us, frames)

    def close(self) -> None:
        self._log.close()


def _frames(datagram: bytes) -> Iterator[bytes]:
    at = 0
    while length := frame_length(datagram, at):
        if at + length <= len(datagram):
            yield datagram[at : at + length]
        at += length
