"""What the tests of streamed setpoints, sticks and targets share: messages as they come off the wire."""

from typing import Any

from hypothesis import strategies as st

from colibri.mavlink.node.service import Peer
from colibri.mavlink.wire.dialect import Codec, Message, mav

FIRST, SECOND = Peer(1, 245, 190), Peer(2, 245, 190)
_CODEC = Codec(245, 190)
_RANGES = {
    "uint8_t": (0, 0xFF),
    "uint16_t": (0, 0xFFFF),
    "int16_t": (-0x8000, 0x7FFF),
    "uint32_t": (0, 0xFFFFFFFF),
    "int32_t": (-0x80000000, 0x7FFFFFFF),
    "uint64_t": (0, 0xFFFFFFFFFFFFFFFF),
}


def message(name: str, **fields: Any) -> Message:
    """Return a message that was encoded and decoded; fields that are not given are zero."""
    definition = getattr(mav, f"MAVLink_{name.lower()}_message")
    lengths = dict(zip(definition.ordered_fieldnames, definition.array_lengths, strict=True))
    assert set(fields) <= set(definition.fieldnames), name
    values = [fields.get(field, [0] * lengths[field] if lengths[field] else 0) for field in definition.fieldnames]
    (decoded,) = _CODEC.decode(_CODEC.encode(name, *values))
    return decoded


def messages(name: str) -> st.SearchStrategy[Message]:
    """Return messages whose fields are anything that the wire can carry, and often what is plausible."""
    definition = getattr(mav, f"MAVLink_{name.lower()}_message")
    types = dict(zip(definition.fieldnames, definition.fieldtypes, strict=True))
    lengths = dict(zip(definition.ordered_fieldnames, definition.array_lengths, strict=True))
    fields = {}
    for field, kind in types.items():
        value = anything(kind)
        fields[field] = st.lists(value, min_size=lengths[field], max_size=lengths[field]) if lengths[field] else value
    fields |= {field: st.integers(0, 25) for field in ("coordinate_frame", "type_mask") if field in types}
    if "type_mask" in types:
        fields["type_mask"] = st.integers(0, 0xFF if types["type_mask"] == "uint8_t" else 0xFFFF)
    if "q" in types:
        rough = st.tuples(*[st.sampled_from([0.5, -0.5])] * 4).map(list)
        fields["q"] = rough | fields["q"]
    return st.fixed_dictionaries(fields).map(lambda chosen: message(name, **chosen))


def anything(kind: str) -> st.SearchStrategy[Any]:
    if kind == "float":
        return st.floats(width=32) | st.floats(-60.0, 60.0, width=32) | st.floats(0.0, 1.0, width=32)
    minimum, maximum = _RANGES[kind]
    return st.integers(minimum, maximum) | st.integers(max(minimum, -1500), min(maximum, 2500))
