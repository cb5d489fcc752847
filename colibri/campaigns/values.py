"""What a factor is set to: each of several values, or a draw from a distribution."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from math import isfinite
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.random import Generator

from colibri.common import elementary
from colibri.common.errors import Error

_MAX_SPAN = 1_000_000


class CampaignError(Error):
    """A campaign that cannot be flown; the message names the key."""


class Draw(Protocol):
    """A distribution that a factor's value is drawn from."""

    def value(self, chance: Generator) -> Any:
        """Return one value; the same for the same stream, on every computer."""

    @property
    def typical(self) -> tuple[Any, ...]:
        """Values that show whether the factor can take what is drawn: the ends, or what lies far out."""


class Uniform(NamedTuple):
    """Each value between `low` and `high` as likely."""

    low: float
    high: float

    def value(self, chance: Generator) -> float:
        """Return one value."""
        return self.low + (self.high - self.low) * float(chance.random())

    @property
    def typical(self) -> tuple[float, ...]:
        """The ends."""
        return self


class LogUniform(NamedTuple):
    """Each ratio as likely, between `low` and `high`, both above zero."""

    low: float
    high: float

    def value(self, chance: Generator) -> float:
        """Return one value."""
        low, high = elementary.log(self.low), elementary.log(self.high)
        return min(max(elementary.exp(low + (high - low) * float(chance.random())), self.low), self.high)

    @property
    def typical(self) -> tuple[float, ...]:
        """The ends."""
        return self


class Normal(NamedTuple):
    """Normally distributed, with a mean and a standard deviation."""

    mean: float
    deviation: float

    def value(self, chance: Generator) -> float:
        """Return one value; of the normal number the bits that every computer agrees on."""
        return self.mean + self.deviation * float(np.float32(chance.standard_normal()))

    @property
    def typical(self) -> tuple[float, ...]:
        """One deviation to both sides."""
        return (self.mean - self.deviation, self.mean + self.deviation)


class Choice(NamedTuple):
    """Each of several values as likely."""

    values: tuple[Any, ...]

    def value(self, chance: Generator) -> Any:
        """Return one value."""
        return self.values[int(chance.integers(len(self.values)))]

    @property
    def typical(self) -> tuple[Any, ...]:
        """All of them."""
        return self.values


_PAIRS: dict[str, Any] = {"uniform": Uniform, "log-uniform": LogUniform, "normal": Normal}
_DISTRIBUTIONS = (*_PAIRS, "choice")
_SPANS = ("linspace", "logspace")


def read_draw(key: str, given: Any) -> Draw:
    """Return the distribution that a campaign has for a factor, `{ uniform = [0.6, 0.8] }` say.

    Raises:
        CampaignError: It is none.
    """
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
        raise CampaignError(f"{key}: {name}: {first:g} to {second:g} is no range")
    if name == "log-uniform" and first <= 0.0:
        raise CampaignError(f"{key}: log-uniform: {first:g} is not above zero")
    draw: Draw = _PAIRS[name](first, second)
    return draw


class Level(NamedTuple):
    """A value of a factor of one's own: a name for what several options and keys are set to together."""

    name: str
    settings: dict[str, Any]


def has_levels(given: Any) -> bool:
    """Tell whether what a campaign has for a factor are levels: tables by their names."""
    return isinstance(given, Mapping) and bool(given) and all(isinstance(each, Mapping) for each in given.values())


def read_values(key: str, given: Any) -> tuple[Any, ...]:
    """Return the values that a campaign has for a factor: a list, `{ linspace = [2, 20, 10] }`, or `2:20:10`.

    Raises:
        CampaignError: They are none, or one is there twice.
    """
    if isinstance(given, Mapping):
        name, span = _only(key, given, _SPANS)
        return _span(key, name, span)
    if isinstance(given, str) and given.count(":") == 2 and all(map(_reads_as_number, given.split(":"))):
        return _span(key, "linspace", [float(part) for part in given.split(":")])
    values = tuple(given) if isinstance(given, list | tuple | range) else (given,)
    if not values:
        raise CampaignError(f"{key}: no values: give at least one")
    if twice := first_twice(map(shown, values)):
        raise CampaignError(f"{key}: {twice} is there twice")
    return values


def first_twice(names: Iterable[str]) -> str:
    """Return the first name that is there twice; empty if none is."""
    return next((name for name, count in Counter(names).items() if count > 1), "")


def shown(value: Any) -> str:
    """Return a value as tables have it: what has a name by its name."""
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
    """Return name and value of what has one of the `known` names."""
    if isinstance(given, Mapping) and len(given) == 1:
        ((name, value),) = given.items()
        if name in known:
            return name, value
    example = "{ uniform = [0.6, 0.8] }" if "uniform" in known else "{ linspace = [2, 20, 10] }, or a list"
    raise CampaignError(f"{key}: expected one of {', '.join(known)}, as in {example}, not {given}")


def _span(key: str, name: str, span: Any) -> tuple[float, ...]:
    """Return numbers from the first to the last, at even distances or even ratios."""
    if not isinstance(span, Sequence) or len(span) != 3 or not all(map(is_number, span)):
        raise CampaignError(f"{key}: {name}: expected [first, last, how many], not {span}")
    first, last, count = float(span[0]), float(span[1]), float(span[2])
    if not count.is_integer() or not 2 <= count <= _MAX_SPAN or first == last:
        raise CampaignError(
            f"{key}: {first:g}:{last:g}:{count:g} is no range: give first, last and how many, 2:20:10 say"
        )
    if name == "linspace":
        return tuple(np.linspace(first, last, int(count)).tolist())
    if first <= 0.0 or last <= 0.0:
        raise CampaignError(f"{key}: logspace: {first:g} to {last:g}: both must be above zero")
    exponents = np.linspace(elementary.log(first), elementary.log(last), int(count)).tolist()
    return tuple(float(f"{elementary.exp(each):.12g}") for each in exponents)


def is_number(value: Any) -> bool:
    """Tell whether a value is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)


def _reads_as_number(text: str) -> bool:
    try:
        return isfinite(float(text))
    except ValueError:
        return False
