"""Component metadata."""

import json

from mavlink.parameters import Kind, Parameter
from mavlink.services.metadata_json import TYPE_PARAMETER, file_crc, general_json, metadata_json

SPEED = Parameter(
    name="SPEED",
    kind=Kind.REAL,
    default=0.1,
    minimum=0.0,
    maximum=0.7,
    unit="m/s",
    decimals=1,
    description="How fast",
    details="Not too fast.",
    group="Flight",
    reboot_required=True,
)
TRACK = Parameter(name="TRACK", kind=Kind.INT, default=2, description="Which", values=((2, "Two"),), read_only=True)


def test_parameters_as_the_schema_has_them() -> None:
    """Keys and types: component_metadata/parameter.schema.json of the MAVLink repository."""
    assert json.loads(metadata_json([SPEED, TRACK])) == {
        "version": 1,
        "parameters": [
            {
                "name": "SPEED",
                "type": "Float",
                "default": 0.1,
                "shortDesc": "How fast",
                "longDesc": "Not too fast.",
                "group": "Flight",
                "units": "m/s",
                "min": 0.0,
                "max": 0.7,
                "decimalPlaces": 1,
                "increment": 0.1,
                "rebootRequired": True,
            },
            {
                "name": "TRACK",
                "type": "Int32",
                "default": 2,
                "shortDesc": "Which",
                "values": [{"value": 2, "description": "Two"}],
                "readOnly": True,
            },
        ],
    }


def test_the_general_file_names_the_others_with_their_checksums() -> None:
    content = metadata_json([SPEED])
    general = json.loads(general_json({TYPE_PARAMETER: ("parameter.json", content)}, "0.1.0"))
    assert general["version"] == 1
    assert general["metadataTypes"] == [{"type": 1, "uri": "mftp:///parameter.json", "fileCrc": file_crc(content)}]


def test_the_checksum_is_mavlinks() -> None:
    """Bit by bit, from the polynomial: begun with 0, not inverted."""
    content = bytes(range(256)) + b"123456789"
    crc = 0
    for byte in content:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xEDB88320 if crc & 1 else 0)
    assert file_crc(content) == crc
    assert file_crc(b"123456789") == 0x2DFD2D88
    assert file_crc(b"") == 0
