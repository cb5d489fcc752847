"""Metadata of the parameters."""

import json

from colibri.mavlink.parameters.metadata import metadata_json
from colibri.mavlink.parameters.store import Kind, Parameter

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
