"""Fast encoding and decoding of the messages in every frame: unsigned, of one component and of fixed length."""

from collections.abc import Sequence
from re import findall
from struct import Struct
from typing import Any

from colibri.mavlink.wire.dialect import CRC_BYTES, CRC_START, HEADER_BYTES, MARKER, Codec, crc16, definition_of

_HEADER = Struct("<4s3B3s").pack


class FixedFrame:
    """A message up to one of its fields; `size` is the frame's length."""

    def __init__(self, name: str, fields: str) -> None:
        """Lay out the first fields in wire order: "controls[4]" is part of an array, "updated:H" has another size."""
        definition = definition_of(name)
        of_dialect = zip(definition.ordered_fieldnames, findall(r"\d*\w", definition.unpacker.format), strict=True)
        numbers, self._names = "", list[tuple[str, int]]()
        for field, (expected, code) in zip(fields.split(), of_dialect, strict=False):
            ((wanted, count, letter),) = findall(r"^(\w+)(?:\[(\d+)\])?(?::(\w))?$", field)
            if wanted != expected:
                raise ValueError(f"{name}: the dialect has {expected} in place of {wanted}")
            unused = Struct(f"<{code}").size - Struct(f"<{count}{code[-1]}").size
            numbers += f"{count}{code[-1]}{unused}x" if count else letter or code
            self._names.append((wanted, int(count or 0)))
        payload = Struct("<" + numbers)
        self._pack = payload.pack
        self._unpack_from = Struct(f"<4sB2s3s{numbers}H").unpack_from
        self._begins = bytes((MARKER, payload.size, 0, 0))
        self._id = definition.id.to_bytes(3, "little")
        self._crc_extra = bytes([definition.crc_extra])
        self._crc_at = HEADER_BYTES + payload.size
        self.size = self._crc_at + CRC_BYTES

    def encode(self, codec: Codec, numbers: Sequence[Any]) -> bytes:
        payload = self._pack(*numbers)
        if codec.seal is not None or not payload[-1]:
            return codec.framed(payload, self._id, self._crc_extra)
        frame = _HEADER(self._begins, codec.next_sequence(), *codec.source, self._id) + payload
        return frame + crc16(frame[1:] + self._crc_extra, CRC_START).to_bytes(CRC_BYTES, "little")

    def read(self, datagram: bytes, at: int, source: bytes) -> tuple[Any, ...] | None:
        """Return the numbers of the frame at byte `at`; `None` unless it is intact, unsigned and of `source`."""
        values = self._unpack_from(datagram, at)
        if values[0] != self._begins or values[2] != source or values[3] != self._id:
            return None
        covered = datagram[at + 1 : at + self._crc_at] + self._crc_extra
        return values[4:-1] if crc16(covered, CRC_START) == values[-1] else None

    def numbers(self, fields: Any) -> list[Any]:
        """Return the numbers of a message that `Codec` has decoded."""
        values = [(getattr(fields, name), count) for name, count in self._names]
        return [number for value, count in values for number in (value[:count] if count else (value,))]
