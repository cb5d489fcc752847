"""Extension fields that the specification gained after the installed dialect was generated.

The checksum of a message does not cover extension fields, and receivers cut off or fill with zeros what they know
differently (https://mavlink.io/en/guide/serialization.html#message-extensions), so these can be sent to anybody.
"""

from struct import Struct
from typing import Any

LATER: dict[str, tuple[tuple[str, str], ...]] = {
    "MISSION_COUNT": (("opaque_id", "uint32_t"),),
    "MISSION_ACK": (("opaque_id", "uint32_t"),),
    "MISSION_CURRENT": (("mission_id", "uint32_t"), ("fence_id", "uint32_t"), ("rally_points_id", "uint32_t")),
}
"""Names and types of the fields, by message, in the order of their definition, which is that of the wire."""
_FORMATS = {"uint32_t": "I"}


def with_later_fields(definition: Any) -> Any:
    """Return pymavlink's class of a message with the extension fields that it lacks."""
    later = [field for field in LATER.get(definition.msgname, ()) if field[0] not in definition.fieldnames]
    if not later:
        return definition
    names, kinds = [name for name, _ in later], [kind for _, kind in later]

    def initialize(*_: Any) -> None:
        raise TypeError("a layout only, not a message of pymavlink's")

    initialize.__defaults__ = (*(definition.__init__.__defaults__ or ()), *[0] * len(later))
    attributes = {
        "fieldnames": [*definition.fieldnames, *names],
        "ordered_fieldnames": [*definition.ordered_fieldnames, *names],
        "fieldtypes": [*definition.fieldtypes, *kinds],
        "lengths": [*definition.lengths, *[1] * len(later)],
        "array_lengths": [*definition.array_lengths, *[0] * len(later)],
        "unpacker": Struct(definition.unpacker.format + "".join(_FORMATS[kind] for kind in kinds)),
        "__init__": initialize,
    }
    return type(definition.__name__, (definition,), attributes)
