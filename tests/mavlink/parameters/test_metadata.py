import json
from zlib import crc32

from colibri.mavlink.files.memory import MemoryFiles
from colibri.mavlink.files.tree import Tree
from colibri.mavlink.parameters.metadata import Metadata, checksum, metadata_json
from colibri.mavlink.parameters.store import Parameter, ParamType
from tests.support.messages import GROUND, on_the_wire

PARAMETERS = b'{"version": 1, "parameters": []}'


def test_the_message_leads_to_the_parameters() -> None:
    metadata = Metadata(PARAMETERS)
    tree = Tree(MemoryFiles(), {}, metadata.files)

    def read(uri: str) -> bytes:
        assert uri.startswith("mftp:///")
        reading = tree.open((uri.removeprefix("mftp:///"),))
        return reading.read(0, reading.size)

    sends = metadata.provide(GROUND, 5_000_000)
    assert [send.channel for send in sends] == [GROUND.channel]
    (message,) = on_the_wire(sends)
    assert (message.name, message.fields.time_boot_ms) == ("COMPONENT_METADATA", 5000)
    general = read(message.fields.uri)
    assert checksum(general) == message.fields.file_crc
    content = json.loads(general)
    assert content["version"] == 1
    (parameters,) = content["metadataTypes"]
    assert parameters["type"] == 1
    assert read(parameters["uri"]) == PARAMETERS
    assert parameters["fileCrc"] == checksum(PARAMETERS)


def test_the_checksum_is_that_of_mavlink() -> None:
    """https://mavlink.io/en/guide/crc.html: zeros do not change a register that begins with zero."""
    assert checksum(b"") == checksum(b"\0\0\0") == 0
    assert checksum(b"\0123456789") == checksum(b"\n3456789")
    assert checksum(b"123456789") == 0x2DFD2D88 != crc32(b"123456789")


SPEED = Parameter(
    name="SPEED",
    kind=ParamType.REAL,
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
TRACK = Parameter(
    name="TRACK", kind=ParamType.INT, default=2, description="Which", values=((2, "Two"),), read_only=True
)


def test_parameters_as_the_schema_has_them() -> None:
    """Keys and types: component_metadata/parameter.schema.json of the MAVLink repository."""
    assert json.loads(metadata_json((SPEED, TRACK))) == {
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
