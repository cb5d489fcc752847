"""Component metadata: what the parameters mean, as JSON files that ground stations fetch by FTP.

Specification: https://mavlink.io/en/services/component_information.html, and the schemas parameter.schema.json and
general.schema.json of the MAVLink repository. The version of both is 1: QGroundControl takes no other.
"""

import json
from collections.abc import Iterable, Mapping
from typing import Any
from zlib import crc32

from mavlink.parameters import LARGEST_INT, LARGEST_REAL, LEAST_INT, Kind, Parameter

GENERAL_NAME, PARAMETER_NAME = "general.json", "parameter.json"
URI = "mftp:///"
"""What a name follows: the files lie at the root of this component's FTP."""
TYPE_PARAMETER = 1
"""COMP_METADATA_TYPE_PARAMETER, which this pymavlink does not know."""

_VERSION = 1
_ALL_BITS = 0xFFFFFFFF
_TYPES = {Kind.INT: "Int32", Kind.REAL: "Float"}


def metadata_json(parameters: Iterable[Parameter]) -> bytes:
    """Return the parameters' metadata: COMP_METADATA_TYPE_PARAMETER."""
    return _encoded({"version": _VERSION, "parameters": [_entry(parameter) for parameter in parameters]})


def general_json(files: Mapping[int, tuple[str, bytes]], version: str) -> bytes:
    """Return the general metadata: COMP_METADATA_TYPE_GENERAL.

    Args:
        files: COMP_METADATA_TYPE -> name and content of each other file.
        version: Of the firmware: numbers between three points at most.
    """
    types = [{"type": kind, "uri": URI + name, "fileCrc": file_crc(content)} for kind, (name, content) in files.items()]
    names = {"vendorName": "Colibri", "modelName": "Colibri", "firmwareVersion": version}
    return _encoded({"version": _VERSION, **names, "metadataTypes": types})


def file_crc(content: bytes) -> int:
    """Return MAVLink's CRC-32 of a file: ISO 3309's, but begun with 0 and not inverted.

    Source: https://mavlink.io/en/guide/crc.html; as PX4 and QGroundControl compute it.
    """
    return crc32(content, _ALL_BITS) ^ _ALL_BITS


def _entry(parameter: Parameter) -> dict[str, Any]:
    """Return a parameter as the schema has it; what is at the schema's default is left out."""
    entry: dict[str, Any] = {
        "name": parameter.name,
        "type": _TYPES[parameter.kind],
        "default": _shortest(parameter, parameter.default),
        "shortDesc": parameter.description,
        "longDesc": parameter.details,
        "group": parameter.group,
        "units": parameter.unit,
    }
    if parameter.minimum not in (LEAST_INT, -LARGEST_REAL):
        entry["min"] = _shortest(parameter, parameter.minimum)
    if parameter.maximum not in (LARGEST_INT, LARGEST_REAL):
        entry["max"] = _shortest(parameter, parameter.maximum)
    if parameter.kind == Kind.REAL:
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
    """Return a number as it was meant before it was rounded to 32 bits, if seven digits say it."""
    return value if parameter.kind == Kind.INT else float(f"{value:.7g}")


def _encoded(content: dict[str, Any]) -> bytes:
    return json.dumps(content, separators=(",", ":")).encode()
