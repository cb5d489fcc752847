"""The messages of every frame of a flight, written and read several times as fast as all others.

Such a message comes unsigned from one component, and ends with a field that is hardly ever zero: its frame has one
length. Its header and payload are read by one `Struct` then, made of the dialect's definition, and fields need no
object: they are numbers in the order of the wire. The bytes are those of `Codec`, which reads all other forms.
"""

from collections.abc import Iterator, Sequence
from re import findall
from struct import Struct
from typing import Any

from colibri.mavlink.wire.dialect import CRC_BYTES, CRC_START, HEADER_BYTES, MARKER, Codec, crc16, definition_of


class FixedFrame:
    """A message up to one of its fields.

    Attributes:
        size: Bytes of its frame.
    """

    def __init__(self, name: str, fields: str) -> None:
        """Lay out message `name` with `fields`, in the order of the wire, parted by blanks; what follows them is zero.

        "controls[4]" is the first four numbers of an array, whose others are zero. "fields_updated:H" is a number of
        another size, by its letter in `struct`: bytes at the end that are zero are not sent.

        Raises:
            ValueError: The dialect has other fields there.
        """
        definition = definition_of(name)
        numbers = "".join(_formats(definition, fields))
        payload = Struct("<" + numbers)
        self._pack = payload.pack
        self._unpack_from = Struct(f"<4sB2s3s{numbers}H").unpack_from
        self._begins = bytes((MARKER, payload.size, 0, 0))
        self._id = definition.id.to_bytes(3, "little")
        self._crc_extra = bytes([definition.crc_extra])
        self._crc_at = HEADER_BYTES + payload.size
        self.size = self._crc_at + CRC_BYTES

    def encode(self, codec: Codec, numbers: Sequence[Any]) -> bytes:
        """Encode as `codec`."""
        return codec.framed(self._pack(*numbers), self._id, self._crc_extra)

    def read(self, datagram: bytes, at: int, source: bytes) -> tuple[Any, ...] | None:
        """Return the numbers of the frame that begins at byte `at` of a datagram that is long enough.

        None if it is not this message, unsigned, of this size and of `source`, with a checksum that holds.
        """
        values = self._unpack_from(datagram, at)
        if values[0] != self._begins or values[2] != source or values[3] != self._id:
            return None
        covered = datagram[at + 1 : at + self._crc_at] + self._crc_extra
        return values[4:-1] if crc16(covered, CRC_START) == values[-1] else None


def _formats(definition: Any, fields: str) -> Iterator[str]:
    """Yield the format of each field, as `struct` has it."""
    of_dialect = zip(definition.ordered_fieldnames, findall(r"\d*\w", definition.unpacker.format), strict=True)
    for field, (name, code) in zip(fields.split(), of_dialect, strict=False):
        ((wanted, count, letter),) = findall(r"^(\w+)(?:\[(\d+)\])?(?::(\w))?$", field)
        if wanted != name:
            raise ValueError(f"{definition.msgname}: the dialect has {name} in place of {wanted}")
        unused = Struct(f"<{code}").size - Struct(f"<{count}{code[-1]}").size
        yield f"{count}{code[-1]}{unused}x" if count else letter or code
