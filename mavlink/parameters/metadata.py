"""The component metadata protocol, over FTP: https://mavlink.io/en/services/component_metadata.html."""

import json
from collections.abc import Mapping
from functools import lru_cache
from typing import Any
from zlib import crc32

from colibri.mavlink.files.tree import Generator
from colibri.mavlink.node.service import Peer, Send, to
from colibri.mavlink.parameters.store import FLOAT32_MAX, INT32_MAX, INT32_MIN, Parameter, ParamType

GENERAL = "general.json"
PARAMETERS = "parameter.json"
TYPE_PARAMETER = 1  # COMP_METADATA_TYPE_PARAMETER

_VERSION = 1
_TYPES = {ParamType.INT: "Int32", ParamType.REAL: "Float"}
_UINT32_MAX = 0xFFFFFFFF


class Metadata:
    """Description of this component in a general file and a file of its parameters."""

    def __init__(self, parameters: bytes) -> None:
        self._parameters = parameters
        types = [{"type": TYPE_PARAMETER, "uri": f"mftp:///{PARAMETERS}", "fileCrc": checksum(parameters)}]
        self.general = json.dumps({"version": _VERSION, "metadataTypes": types}).encode()

    @property
    def files(self) -> Mapping[str, Generator]:
        return {GENERAL: lambda _: self.general, PARAMETERS: lambda _: self._parameters}

    def provide(self, peer: Peer, now_us: int) -> list[Send]:
        time_boot_ms = now_us // 1000 & _UINT32_MAX
        return [to(peer, "COMPONENT_METADATA", time_boot_ms, checksum(self.general), f"mftp:///{GENERAL}".encode())]


def checksum(data: bytes) -> int:
    """Return MAVLink's CRC32: https://mavlink.io/en/guide/crc.html."""
    return crc32(data, _UINT32_MAX) ^ _UINT32_MAX


@lru_cache(maxsize=16)
def metadata_json(parameters: tuple[Parameter, ...]) -> bytes:
    """Return MAVLink's component_metadata/parameter.schema.json."""
    content = {"version": _VERSION, "parameters": [_entry(parameter) for parameter in parameters]}
    return json.dumps(content, separators=(",", ":")).encode()


def _entry(parameter: Parameter) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "name": parameter.name,
        "type": _TYPES[parameter.kind],
        "default": _shortest(parameter, parameter.default),
        "shortDesc": parameter.description,
        "longDesc": parameter.details,
        "group": parameter.group,
        "units": parameter.unit,
    }
    if parameter.minimum not in (INT32_MIN, -FLOAT32_MAX):
        entry["min"] = _shortest(parameter, parameter.minimum)
    if parameter.maximum not in (INT32_MAX, FLOAT32_MAX):
        entry["max"] = _shortest(parameter, parameter.maximum)
    if parameter.kind == ParamType.REAL:
        entry["decimalPlaces"] = parameter.decimals
        entry["increment"] = float(f"1e-{min(parameter.decimals, 2)}")
    if parameter.values:
        entry["values"] = [{"value": value, "description": what} for value, what in parameter.values]
    if parameter.reboot_required:
        entry["rebootRequired"] = True
    if parameter.read_only:
        entry["readOnly"] = True
    return {key: value for key, value in entry.items() if value != ""}


def _shortest(parameter: Parameter, value: float) -> float:
    return value if parameter.kind == ParamType.INT else float(f"{value:.7g}")
