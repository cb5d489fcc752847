"""Messages that pymavlink's dialect lacks: defined so that peers understand them."""

from typing import Any

import pytest

from colibri.mavlink.wire.dialect import Codec, mav
from colibri.mavlink.wire.missing_messages import MISSING, Definition, add_to

KNOWN = {
    "COMMAND_CANCEL": (14, 4),
    "ESC_INFO": (251, 46),
    "ESC_STATUS": (10, 57),
    "COMPONENT_METADATA": (182, 108),
    "MEMINFO": (208, 4),
    "AHRS": (127, 28),
    "SIMSTATE": (154, 44),
    "WIND": (1, 12),
    "AHRS2": (47, 24),
    "AUTOPILOT_VERSION_REQUEST": (85, 2),
    "EKF_STATUS_REPORT": (71, 22),
}
"""CRC_EXTRA and length of the payload, as MAVLink's own generator gives them."""


@pytest.mark.parametrize("definition", MISSING, ids=lambda definition: definition.name)
def test_the_checksum_is_the_one_that_peers_have(definition: Definition) -> None:
    kind = mav.mavlink_map[definition.id]
    assert (kind.crc_extra, kind.unpacker.size) == KNOWN[definition.name]


@pytest.mark.parametrize("definition", MISSING, ids=lambda definition: definition.name)
def test_fields_survive_the_wire(definition: Definition) -> None:
    values: list[Any] = []
    for number, field in enumerate(definition.fields, start=1):
        if field.kind == "char":
            values.append(b"mftp://somewhere")
        else:
            values.append(tuple(range(number, number + field.length)) if field.length else number)
    codec = Codec(1, 1)
    (message,) = codec.decode(codec.encode(definition.name, *values))
    assert message.name == definition.name
    for field, value in zip(definition.fields, values, strict=True):
        received = getattr(message.fields, field.name)
        received = received.encode() if isinstance(received, str) else received
        assert (tuple(received) if field.length and field.kind != "char" else received) == value


def test_pymavlink_reads_them_too() -> None:
    reader = mav.MAVLink(None)
    values = (0, 5, (1, 2, 3, 4), (1.0, 2.0, 3.0, 4.0), (5.0, 6.0, 7.0, 8.0))
    (message,) = reader.parse_buffer(Codec(1, 1).encode("ESC_STATUS", *values))
    assert (message.get_type(), message.index, message.time_usec) == ("ESC_STATUS", 0, 5)
    assert (tuple(message.rpm), tuple(message.voltage), tuple(message.current)) == values[2:]


def test_what_the_dialect_has_is_left_alone() -> None:
    before = dict(mav.mavlink_map)
    add_to(mav)
    assert mav.mavlink_map == before
