"""Factors: options of `colibri fly`, and dotted keys of profiles and vehicles."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from colibri.autopilot.control.profile import Profile, ProfileTables
from colibri.campaigns.values import CampaignError, is_number
from colibri.common.config import value_at
from colibri.common.errors import unknown
from colibri.common.spec import keywords_of
from colibri.flights.spec import FlightSpec
from colibri.plant.vehicle.description import Vehicle, VehicleError

SCALED = "*"
"""Suffix of a key whose value multiplies the file's."""
_TABLES = ("profile", "vehicle", "plant-vehicle")
_OF_A_PROFILE = tuple(f"{key}." for key in ProfileTables.__struct_fields__)
_NOT_FACTORS = ("seed", "link", "speed")


class Key(NamedTuple):
    """A key of a profile or vehicle; `scaled` if its value is a multiplier."""

    table: str
    key: str
    scaled: bool


def factor_name(given: str) -> str:
    """Return the canonical name; `profile.` may be left out."""
    options = [name for name in keywords_of(FlightSpec) if name not in _NOT_FACTORS]
    name = given.replace("-", "_")
    if name in options:
        return name
    if given.startswith(_OF_A_PROFILE):
        return f"profile.{given}"
    table, dot, rest = given.partition(".")
    if dot and rest and table.replace("_", "-") in _TABLES:
        return f"{table.replace('_', '-')}.{rest}"
    if name == "seed":
        raise CampaignError("seed is not a factor: set seeds, for example 1-20")
    if name in _NOT_FACTORS:
        raise CampaignError(f"{given} is not a factor: it does not change a flight")
    known = sorted({*options, *(f"{table}.KEY" for table in _TABLES)})
    raise CampaignError(unknown("factor", given, known))


def key_of(factor: str) -> Key | None:
    table, dot, rest = factor.partition(".")
    if not dot:
        return None
    return Key(table, rest.removesuffix(SCALED), rest.endswith(SCALED))


def with_keys(factors: Mapping[str, Any], table: str, of: Profile | Vehicle) -> Any:
    changed: Any = of
    for factor, value in factors.items():
        key = key_of(factor)
        if key is not None and key.table == table:
            to = _scaled(_had(changed, key.key), value, factor) if key.scaled else value
            changed = changed.replace(key.key, to)
    return changed


def _had(of: Profile | Vehicle, key: str) -> Any:
    return of.value(key) if isinstance(of, Profile) else value_at(of, key, VehicleError)


def _scaled(had: Any, by: Any, factor: str) -> Any:
    if isinstance(had, list):
        return [_scaled(each, by, factor) for each in had]
    if not (is_number(had) and is_number(by)):
        raise CampaignError(f"{factor}: {had} times {by} is not a number: leave the {SCALED} out")
    return had * by
