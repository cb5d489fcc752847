"""Ranges of tuned numbers, and objectives: metrics pooled over a trial's flights."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from colibri.campaigns.definition import NAMES, Metric, read_metrics
from colibri.campaigns.factors import Choice, LogUniform, Uniform, is_number, read_draw, shown
from colibri.campaigns.flights import FlightResult, Verdict
from colibri.common.errors import Error, unknown
from colibri.common.types import Array

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


SHARE_LOST = "share_lost"
LOST_COUNTS = 10.0
"""A lost flight counts this many times the largest original value."""
_POOLINGS = ("mean", "rms", "median", "largest")
_NOT_SMALL = ("lost_at_s",)


class Objective(NamedTuple):
    """A metric to minimize, or `share_lost`, and its pooling over flights."""

    metric: str
    pooling: str = "mean"
    quantile: float | None = None

    @property
    def name(self) -> str:
        if self.metric == SHARE_LOST:
            return SHARE_LOST
        return f"{self.metric}, {self.pooling if self.quantile is None else f'quantile {self.quantile:g}'}"

    def of_flights(self, flown: Sequence[FlightResult], metrics: Sequence[Metric], worst: float) -> Array:
        """Return each flight's value, (n,), at most `worst`."""
        if self.metric == SHARE_LOST:
            return np.array([float(each.verdict is not Verdict.FLOWN) for each in flown])
        place = [metric.name for metric in metrics].index(self.metric)
        return np.array([min(value_of(each, place, worst), worst) for each in flown])

    def worst(self, flown: Sequence[FlightResult], metrics: Sequence[Metric]) -> float:
        """Return the value of a lost flight, by the original profile."""
        if self.metric == SHARE_LOST:
            return 1.0
        place = [metric.name for metric in metrics].index(self.metric)
        through = [each for each in flown if each.verdict is Verdict.FLOWN]
        if not through:
            raise TuningError(f"no flight of the profile as it is came through: {flown[0].why}")
        values = [value for each in through if (value := each.metrics[place]) is not None]
        if len(values) < len(through):
            raise TuningError(f"{self.metric} is missing in some flights: fly longer, or choose another objective")
        if min(values) < 0.0:
            raise TuningError(f"{self.metric} is {min(values):g} in a flight: an objective must not be below zero")
        return LOST_COUNTS * (max(values) or 1.0)

    def pooled(self, values: Array, axis: int = -1) -> Any:
        if self.quantile is not None:
            return np.quantile(values, self.quantile, axis=axis)
        if self.pooling == "rms":
            return np.sqrt(np.mean(np.square(values), axis=axis))
        pool: Any = {"mean": np.mean, "median": np.median, "largest": np.max}[self.pooling]
        return pool(values, axis=axis)


def value_of(flown: FlightResult, place: int, otherwise: float) -> float:
    value = flown.metrics[place]
    return value if flown.verdict is Verdict.FLOWN and value is not None else otherwise


def read_objectives(given: Mapping[str, Any], metrics: Sequence[Metric]) -> tuple[Objective, ...]:
    """Read objectives such as `{ rmse_m = "mean" }`."""
    if not given:
        raise TuningError('objectives: none: add for example rmse_after_20s_m = "mean"')
    return tuple(_objective(name, pooling, metrics) for name, pooling in given.items())


def _objective(name: str, pooling: Any, metrics: Sequence[Metric]) -> Objective:
    known = tuple(dict.fromkeys((*(metric.name for metric in metrics), *NAMES, SHARE_LOST)))
    if name in _NOT_SMALL:
        raise TuningError(f"objectives: {name} is not an objective to minimise: choose {SHARE_LOST}")
    if name not in known:
        raise TuningError(f"objectives: {unknown('metric', name, known)}")
    if name == SHARE_LOST:
        if pooling != "mean":
            raise TuningError(f'objectives: {SHARE_LOST} is a mean: write {SHARE_LOST} = "mean"')
        return Objective(SHARE_LOST)
    if isinstance(pooling, Mapping) and list(pooling) == ["quantile"]:
        part = pooling["quantile"]
        if not is_number(part) or not 0.0 <= part <= 1.0:
            raise TuningError(f"objectives: {name}: quantile: expected 0 to 1, not {part}")
        return Objective(name, "quantile", float(part))
    if pooling not in _POOLINGS:
        raise TuningError(f"objectives: {name}: choose {', '.join(_POOLINGS)} or {{ quantile = 0.9 }}, not {pooling}")
    return Objective(name, pooling)


def metrics_of(objectives: Sequence[Objective], metrics: Sequence[Metric]) -> tuple[Metric, ...]:
    names = {metric.name: metric for metric in metrics}
    needed = [each.metric for each in objectives if each.metric != SHARE_LOST]
    found = {name: names.get(name) or read_metrics([name])[0] for name in needed}
    return tuple((found | {name: metric for name, metric in names.items() if name not in found}).values())
