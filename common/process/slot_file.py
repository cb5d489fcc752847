"""A file of two slots, written in turn: it survives a crash at any instant with the last complete write."""

import os
from pathlib import Path
from struct import Struct
from zlib import crc32

from colibri.common.files import regular

SLOT = 256 << 10
_HEAD = Struct("<QII")  # number, from 1; length; checksum of both and of the content
_COUNTED = Struct("<QI")
MAX_BYTES = SLOT - _HEAD.size  # capacity of a slot


class Slots:
    """The newest content, on disk."""

    def __init__(self, path: Path) -> None:
        """Open or create the file, and write all of it: so the disk has room."""
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = regular(str(path), os.O_RDWR | os.O_CREAT)
        content = os.read(self._file, 2 * SLOT + 1)
        if len(content) != 2 * SLOT:
            content = bytes(2 * SLOT)
            os.truncate(self._file, 0)
        os.pwrite(self._file, content, 0)
        self._number = max((number for number, _ in self._whole()), default=0)

    def newest(self) -> bytes | None:
        return max(self._whole(), default=(0, None))[1]

    def write(self, content: bytes) -> bool:
        """Replace the older slot by `content`; return whether it fits and is written."""
        if len(content) > MAX_BYTES:
            return False
        number = self._number + 1
        head = _HEAD.pack(number, len(content), _checksum(number, content))
        try:
            written = os.pwrite(self._file, head + content, SLOT * (number % 2))
        except OSError:  # truncated meanwhile, and the disk is full
            return False
        self._number = number
        return written == len(head) + len(content)

    def close(self) -> None:
        if self._file >= 0:
            os.close(self._file)
        self._file = -1

    def _whole(self) -> list[tuple[int, bytes]]:
        slots = []
        for at in (0, SLOT):
            slot = os.pread(self._file, SLOT, at)
            if len(slot) < _HEAD.size:
                continue
            number, length, checksum = _HEAD.unpack_from(slot)
            content = slot[_HEAD.size : _HEAD.size + length]
            if number and len(content) == length and _checksum(number, content) == checksum:
                slots.append((number, content))
        return slots


def _checksum(number: int, content: bytes) -> int:
    return crc32(content, crc32(_COUNTED.pack(number, len(content))))
