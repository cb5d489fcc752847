"""Records of a few fields, as of a frame or a step."""

from typing import Any, Self

import msgspec


class Record(msgspec.Struct, frozen=True, array_like=True):
    """An immutable record, made in a quarter of the time of a named tuple."""

    def _replace(self, **changes: Any) -> Self:
        """Return a copy with `changes`, as a named tuple does."""
        return msgspec.structs.replace(self, **changes)


tuple_of = tuple.__new__
"""Make a named tuple of all its fields, `tuple_of(kind, (field, ...))`, in half the time of a call."""
