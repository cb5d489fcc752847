"""Ranges of tuned numbers: uniform, log-uniform, integers, choices."""

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

from colibri.campaigns.values import Choice, LogUniform, Uniform, is_number, read_draw, shown
from colibri.common.errors import Error

_KINDS = ("uniform", "log-uniform", "integers", "choice")
_DIGITS = 4


class TuningError(Error):
    """A tuning is invalid; the message names the key."""


class Integers(NamedTuple):
    """Integers from `low` to `high`, inclusive."""

    low: int
    high: int

    @property
    def typical(self) -> tuple[int, ...]:
        return self


Range: TypeAlias = Uniform | LogUniform | Integers | Choice


def read_range(key: str, given: Any) -> Range:
    """Read a range such as `{ log-uniform = [2, 20] }`."""
    kind = next(iter(given)) if isinstance(given, dict) and len(given) == 1 else None
    if kind not in _KINDS:
        raise TuningError(f"{key}: expected one of {', '.join(_KINDS)}, as in {{ uniform = [2, 20] }}, not {given}")
    if kind != "integers":
        read = read_draw(key, given)
        if not isinstance(read, Uniform | LogUniform | Choice):
            raise TypeError(read)
        if isinstance(read, Choice) and len(read.values) < 2:
            raise TuningError(f"{key}: choice: needs two values or more")
        return read
    span = given[kind]
    if not isinstance(span, Sequence) or len(span) != 2 or any(type(end) is not int for end in span):
        raise TuningError(f"{key}: integers: expected [lowest, highest], not {span}")
    if span[0] >= span[1]:
        raise TuningError(f"{key}: integers: {span[0]} to {span[1]} is an empty range")
    return Integers(*span)


def check_holds(key: str, values: Range, value: Any) -> None:
    """Check that the original value, where tuning starts, is in range."""
    if isinstance(values, Choice):
        if value not in values.values:
            raise TuningError(
                f"{key}: the profile has {shown(value)}: put it among {', '.join(map(shown, values.values))}"
            )
        return
    if not is_number(value):
        raise TuningError(f"{key}: the profile has {shown(value)}, not a number: tune an element, for example {key}.0")
    if not values.low <= value <= values.high:
        raise TuningError(f"{key}: the profile has {value:g}, not within {values.low:g} to {values.high:g}: widen that")


def distribution(values: Range) -> Any:
    from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution

    if isinstance(values, Choice):
        return CategoricalDistribution(list(map(shown, values.values)))
    if isinstance(values, Integers):
        return IntDistribution(*values)
    return FloatDistribution(values.low, values.high, log=isinstance(values, LogUniform))


def as_tried(values: Range, value: Any) -> Any:
    """Round a value to four digits, for people to read and write."""
    if not isinstance(values, Uniform | LogUniform):
        return value
    return min(max(float(f"{value:.{_DIGITS}g}"), values.low), values.high)


def as_optuna(values: Range, value: Any) -> Any:
    return shown(value) if isinstance(values, Choice) else value


def as_flown(values: Range, value: Any) -> Any:
    if isinstance(values, Choice):
        return next(each for each in values.values if shown(each) == value)
    return value
