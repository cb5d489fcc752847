"""Values of factors, and their names: options of `colibri fly` and dotted keys."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from math import isfinite
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.random import Generator

from colibri.autopilot.control.profile import Profile, ProfileTables
from colibri.common import elementary
from colibri.common.config import value_at
from colibri.common.errors import Error, unknown
from colibri.common.process.arguments import number
from colibri.common.spec import keywords_of
from colibri.flights.spec import FlightSpec
from colibri.plant.vehicle.description import Vehicle, VehicleError

_MAX_SPAN = 1_000_000


class CampaignError(Error):
    """A campaign is invalid; the message names the key."""


class Uniform(NamedTuple):
    low: float
    high: float

    def value(self, chance: Generator) -> float:
        return self.low + (self.high - self.low) * float(chance.random())

    @property
    def typical(self) -> tuple[float, ...]:
        return self


class LogUniform(Uniform):
    """Log-uniform between `low` and `high`, both positive."""

    __slots__ = ()

    def value(self, chance: Generator) -> float:
        low, high = elementary.log(self.low), elementary.log(self.high)
        return min(max(elementary.exp(low + (high - low) * float(chance.random())), self.low), self.high)


class Normal(NamedTuple):
    mean: float
    deviation: float

    def value(self, chance: Generator) -> float:
        """Round the normal number to float32, in which all computers agree."""
        return self.mean + self.deviation * float(np.float32(chance.standard_normal()))

    @property
    def typical(self) -> tuple[float, ...]:
        return (self.mean - self.deviation, self.mean + self.deviation)


class Choice(NamedTuple):
    """One of several values, with equal probability."""

    values: tuple[Any, ...]

    def value(self, chance: Generator) -> Any:
        return self.values[int(chance.integers(len(self.values)))]

    @property
    def typical(self) -> tuple[Any, ...]:
        return self.values


Draw: TypeAlias = Uniform | Normal | Choice
"""A distribution, reproducible on every computer; `typical` values test a factor: the ends, or mean ± one deviation."""
_PAIRS: dict[str, Any] = {"uniform": Uniform, "log-uniform": LogUniform, "normal": Normal}
_PLAIN = (str, int, float, Mapping, list, tuple)
_DISTRIBUTIONS = (*_PAIRS, "choice")
_SPANS = ("linspace", "logspace")


def read_draw(key: str, given: Any) -> Draw:
    name, values = _only(key, given, _DISTRIBUTIONS)
    if name == "choice":
        return Choice(read_values(key, values))
    if not isinstance(values, Sequence) or len(values) != 2 or not all(map(is_number, values)):
        what = "[mean, standard deviation]" if name == "normal" else "[lowest, highest]"
        raise CampaignError(f"{key}: {name}: expected {what}, not {values}")
    first, second = map(float, values)
    if name == "normal":
        if second < 0.0:
            raise CampaignError(f"{key}: normal: the standard deviation is negative: {second:g}")
    elif first >= second:
        raise CampaignError(f"{key}: {name}: {first:g} to {second:g} is an empty range")
    if name == "log-uniform" and first <= 0.0:
        raise CampaignError(f"{key}: log-uniform: {first:g} is not above zero")
    draw: Draw = _PAIRS[name](first, second)
    return draw


class Level(NamedTuple):
    """A named set of options and keys: one value of a user's own factor."""

    name: str
    settings: dict[str, Any]


def has_levels(given: Any) -> bool:
    return isinstance(given, Mapping) and bool(given) and all(isinstance(each, Mapping) for each in given.values())


def read_values(key: str, given: Any) -> tuple[Any, ...]:
    if isinstance(given, Mapping):
        name, span = _only(key, given, _SPANS)
        return _span(key, name, span)
    if isinstance(given, str) and given.count(":") == 2:
        with suppress(ValueError):  # else it is a name
            return _span(key, "linspace", list(map(number, given.split(":"))))
    if isinstance(given, range) and len(given[: _MAX_SPAN + 1]) > _MAX_SPAN:
        raise CampaignError(f"{key}: at most {_MAX_SPAN} values, not {given}")
    several = isinstance(given, list | tuple | range) and not hasattr(given, "_fields")
    values = tuple(given) if several else (given,)
    if not values:
        raise CampaignError(f"{key}: no values: give at least one")
    if twice := first_twice(map(shown, values)):
        objects = [value for value in values if shown(value) == twice]
        if isinstance(objects[0], _PLAIN) or any(objects[0] == other for other in objects[1:]):
            raise CampaignError(f"{key}: {twice} is there twice")
        names = [f"{getattr(value, '__module__', '')}.{shown(value)}" for value in values]
        if first_twice(names):
            names = [f"{shown(value)} ({place})" for place, value in enumerate(values, 1)]
        return tuple(Level(name, {key: value}) for name, value in zip(names, values, strict=True))
    return values


def first_twice(names: Iterable[str]) -> str:
    """Return the first duplicate, or an empty text."""
    return next((name for name, count in Counter(names).items() if count > 1), "")


def shown(value: Any) -> str:
    """Format a value for tables; an object by its name."""
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Mapping):
        return ",".join(f"{key}={shown(each)}" for key, each in value.items())
    if isinstance(value, list | tuple) and not hasattr(value, "_fields"):
        return " ".join(map(shown, value))
    return str(getattr(value, "__name__", None) or getattr(value, "name", None) or value)


def _only(key: str, given: Any, known: Sequence[str]) -> tuple[str, Any]:
    if isinstance(given, Mapping) and len(given) == 1:
        ((name, value),) = given.items()
        if name in known:
            return name, value
    example = "{ uniform = [0.6, 0.8] }" if "uniform" in known else "{ linspace = [2, 20, 10] }, or a list"
    raise CampaignError(f"{key}: expected one of {', '.join(known)}, as in {example}, not {given}")


def _span(key: str, name: str, span: Any) -> tuple[float, ...]:
    if not isinstance(span, Sequence) or len(span) != 3 or not all(map(is_number, span)):
        raise CampaignError(f"{key}: {name}: expected [first, last, how many], not {span}")
    first, last, count = float(span[0]), float(span[1]), float(span[2])
    if not count.is_integer() or not 2 <= count <= _MAX_SPAN or first == last:
        given = f"{first:g}:{last:g}:{count:g}"
        raise CampaignError(f"{key}: {given} is not a range: give FIRST:LAST:COUNT, for example 2:20:10")
    if name == "linspace":
        return tuple(np.linspace(first, last, int(count)).tolist())
    if first <= 0.0 or last <= 0.0:
        raise CampaignError(f"{key}: logspace: {first:g} to {last:g}: both must be above zero")
    exponents = np.linspace(elementary.log(first), elementary.log(last), int(count)).tolist()
    return tuple(float(f"{elementary.exp(each):.12g}") for each in exponents)


def is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)


SCALED = "*"  # suffix of a key whose value multiplies the file's
_TABLES = ("profile", "vehicle", "plant-vehicle")
_OF_A_PROFILE = tuple(f"{key}." for key in ProfileTables.__struct_fields__)
_NOT_FACTORS = ("seed", "link", "speed")


class Key(NamedTuple):
    """A key of a profile or vehicle; a `scaled` value is a multiplier."""

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
            if key.scaled:
                of_profile = isinstance(changed, Profile)
                had = changed.value(key.key) if of_profile else value_at(changed, key.key, VehicleError)
                value = _scaled(had, value, factor)
            changed = changed.replace(key.key, value)
    return changed


def _scaled(had: Any, by: Any, factor: str) -> Any:
    if isinstance(had, list):
        return [_scaled(each, by, factor) for each in had]
    if not (is_number(had) and is_number(by)):
        raise CampaignError(f"{factor}: {had} times {by} is not a number: leave the {SCALED} out")
    return had * by
