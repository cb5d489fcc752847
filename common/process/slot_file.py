"""A file of two slots that outlives the process at any instant: what was written last and whole is what it holds.

The file is mapped into memory, so a write is a copy: the system has it at once, also when the process is killed the
instant after. Slots are written in turn, each with a number and a checksum, so one of them is always whole. Only a
computer that loses its power may lose more.
"""

from mmap import mmap
from pathlib import Path
from struct import Struct
from zlib import crc32

SLOT = 256 << 10
_HEAD = Struct("<QII")
"""Number, from 1 on; length; checksum of both and of the content."""
_COUNTED = Struct("<QI")
MAX_BYTES = SLOT - _HEAD.size
"""Bytes that fit."""


class Slots:
    """Keeps the newest of what it is given."""

    def __init__(self, path: Path) -> None:
        """Open the file, made where it is missing or of another size.

        All of it is written once: a page for which the disk has no room would end the process by SIGBUS.

        Raises:
            OSError: It cannot be made, read or written.
        """
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("r+b" if path.exists() else "w+b") as file:
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
        """Return what was written last; None before anything was."""
        return max(self._whole(), default=(0, None))[1]

    def write(self, content: bytes) -> bool:
        """Keep `content` in place of what was written before the last; return whether it fits."""
        if len(content) > MAX_BYTES:
            return False
        number = self._number + 1
        at = SLOT * (number % 2)
        self._map[at + _HEAD.size : at + _HEAD.size + len(content)] = content
        _HEAD.pack_into(self._map, at, number, len(content), _checksum(number, content))
        self._number = number
        return True

    def close(self) -> None:
        """Let go of the file."""
        self._map.close()

    def _whole(self) -> list[tuple[int, bytes]]:
        """Return number and content of each slot that is whole."""
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
