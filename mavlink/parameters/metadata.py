"""The component metadata protocol: where ground stations can read what this vehicle and its parameters are.

Specification: https://mavlink.io/en/services/component_metadata.html. The files themselves go by file transfer.
"""

import json
from collections.abc import Mapping
from zlib import crc32

from colibri.mavlink.files.tree import Generator
from colibri.mavlink.node.service import Peer, Send, to

GENERAL = "general.json"
PARAMETERS = "parameter.json"
TYPE_PARAMETER = 1
"""COMP_METADATA_TYPE_PARAMETER."""

_UINT32_MAX = 0xFFFFFFFF


class Metadata:
    """What describes this component.

    Attributes:
        general: The general file, which names the others with their checksums.
    """

    def __init__(self, parameters: bytes) -> None:
        """Describe the component by the JSON of its parameters, which never changes."""
        self._parameters = parameters
        types = [{"type": TYPE_PARAMETER, "uri": f"mftp:///{PARAMETERS}", "fileCrc": checksum(parameters)}]
        self.general = json.dumps({"version": 1, "metadataTypes": types}).encode()

    @property
    def files(self) -> Mapping[str, Generator]:
        """The files to show, by path: for the vehicle's `Tree`."""
        return {GENERAL: lambda _: self.general, PARAMETERS: lambda _: self._parameters}

    def provide(self, peer: Peer, now_us: int) -> list[Send]:
        """Answer MAV_CMD_REQUEST_MESSAGE for COMPONENT_METADATA (397)."""
        time_boot_ms = now_us // 1000 & _UINT32_MAX
        return [to(peer, "COMPONENT_METADATA", time_boot_ms, checksum(self.general), f"mftp:///{GENERAL}".encode())]


def checksum(data: bytes) -> int:
    """Return MAVLink's CRC32, which begins with 0 and inverts nothing: https://mavlink.io/en/guide/crc.html."""
    return crc32(data, _UINT32_MAX) ^ _UINT32_MAX
