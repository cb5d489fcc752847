"""Records of a few fields, as of a frame or a step."""

from typing import Any, Self

import msgspec


class Record(msgspec.Struct, frozen=True, array_like=True):
    """An immutable record, made in a quarter of the time of a named tuple."""

    def _replace(self, **changes: Any) -> Self:
        """Return a copy with `changes`, as a named tuple does."""
        return msgspec.structs.replace(self, **changes)
