"""Component metadata: the message, the general file, and the checksums of both files."""

import json
from zlib import crc32

from colibri.mavlink.files.memory import Memory
from colibri.mavlink.files.tree import Reading, Tree
from colibri.mavlink.parameters.metadata import Metadata, checksum
from tests.support.messages import GROUND, on_the_wire

PARAMETERS = b'{"version": 1, "parameters": []}'


def test_the_message_leads_to_the_parameters() -> None:
    metadata = Metadata(PARAMETERS)
    tree = Tree(Memory(), {}, metadata.files)

    def read(uri: str) -> bytes:
        assert uri.startswith("mftp:///")
        reading = tree.open((uri.removeprefix("mftp:///"),))
        assert isinstance(reading, Reading)
        data = reading.read(0, reading.size)
        assert isinstance(data, bytes)
        return data

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


def test_the_time_goes_round() -> None:
    (message,) = on_the_wire(Metadata(b"").provide(GROUND, (2**32 + 7) * 1000))
    assert message.fields.time_boot_ms == 7
