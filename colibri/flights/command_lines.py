"""The command lines of plant and autopilot, written from values by option name; loads nothing."""

from collections.abc import Mapping
from math import inf

from colibri.plant.simulation.setting import WorldSetting, world_values

_NAMES = {"gusts": "gust"}
"""Of options that may be repeated."""


def options_of(**values: object) -> list[str]:
    """Return the options for `values` by name; None, False and empty values are left out."""
    return [option for name, value in values.items() for option in _said(f"--{_NAMES.get(name, name)}", value)]


def plant_options(world: WorldSetting, **others: object) -> list[str]:
    """Return the command line of a plant in `world`, with other options by their names."""
    return options_of(**world_values(world), **others)


def _said(name: str, value: object) -> list[str]:
    option = name.replace("_", "-")
    if isinstance(value, (list, tuple)) and not hasattr(value, "_fields"):  # a named tuple is one value
        return [f"{option}={each}" for each in value]
    if isinstance(value, Mapping):
        value = ",".join(f"{key}={each!r}" for key, each in value.items())
    if value is True:
        return [option]
    if value is None or value is False or value == "":
        return []
    return [f"{option}={'max' if value == inf else value}"]
