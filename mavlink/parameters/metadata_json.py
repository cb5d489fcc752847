"""What the parameters mean, as the JSON file that ground stations fetch by FTP: COMP_METADATA_TYPE_PARAMETER.

Specification: https://mavlink.io/en/services/component_metadata.html, and component_metadata/parameter.schema.json of
the MAVLink repository. The version is 1: QGroundControl takes no other.
"""

import json
from collections.abc import Iterable
from typing import Any

from colibri.mavlink.parameters.store import FLOAT32_MAX, INT32_MAX, INT32_MIN, Kind, Parameter

_VERSION = 1
_TYPES = {Kind.INT: "Int32", Kind.REAL: "Float"}


def metadata_json(parameters: Iterable[Parameter]) -> bytes:
    """Return the file."""
    content = {"version": _VERSION, "parameters": [_entry(parameter) for parameter in parameters]}
    return json.dumps(content, separators=(",", ":")).encode()


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
    if parameter.minimum not in (INT32_MIN, -FLOAT32_MAX):
        entry["min"] = _shortest(parameter, parameter.minimum)
    if parameter.maximum not in (INT32_MAX, FLOAT32_MAX):
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
