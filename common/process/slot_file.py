"""A file of two slots that survives a crash at any instant with the last complete write.

The file is memory-mapped, so the system has a write at once. Slots are written alternately with number and checksum.
Only a power failure may lose more.
"""

from mmap import mmap
from pathlib import Path
from struct import Struct
from zlib import crc32

from colibri.common.files import regular

SLOT = 256 << 10
_HEAD = Struct("<QII")
"""Number, from 1; length; checksum of both and of the content."""
_COUNTED = Struct("<QI")
MAX_BYTES = SLOT - _HEAD.size
"""Capacity of a slot."""


class Slots:
    """The newest content, on disk."""

    def __init__(self, path: Path) -> None:
        """Open or create the file. All of it is written: a page without disk space would later raise SIGBUS."""
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(path, "r+b" if path.exists() else "w+b", opener=regular) as file:
            content = file.read()
            if len(content) != 2 * SLOT:
                content = bytes(2 * SLOT)
                file.truncate(0)
            file.seek(0)
            file.write(content)
            file.flush()
            self._map = mmap(file.fileno(), 2 * SLOT)
        self._number = max((number for number, _ in self._whole()), default=0)

    def newest(self) -> bytes | None:
        return max(self._whole(), default=(0, None))[1]

    def write(self, content: bytes) -> bool:
        """Replace the older slot by `content`, if it fits."""
        if len(content) > MAX_BYTES:
            return False
        number = self._number + 1
        at = SLOT * (number % 2)
        self._map[at + _HEAD.size : at + _HEAD.size + len(content)] = content
        _HEAD.pack_into(self._map, at, number, len(content), _checksum(number, content))
        self._number = number
        return True

    def close(self) -> None:
        self._map.close()

    def _whole(self) -> list[tuple[int, bytes]]:
        slots = []
        for at in (0, SLOT):
            number, length, checksum = _HEAD.unpack_from(self._map, at)
            if number and length <= MAX_BYTES:
                content = self._map[at + _HEAD.size : at + _HEAD.size + length]
                if _checksum(number, content) == checksum:
                    slots.append((number, content))
        return slots


def _checksum(number: int, content: bytes) -> int:
    return crc32(content, crc32(_COUNTED.pack(number, len(content))))
