"""A tuning as data: ranges of tuned numbers, and objectives, which are metrics pooled over a trial's flights."""

from collections.abc import Mapping, Sequence
from math import ceil
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, TypeAlias

import msgspec
import numpy as np

from colibri.autopilot.control.profile import Profile, profile_text
from colibri.campaigns.definition import (
    MAX_UNASKED,
    NAMES,
    Campaign,
    CampaignTables,
    FlightTables,
    Metric,
    Point,
    campaign_of,
    read_metrics,
    read_seeds,
)
from colibri.campaigns.factors import (
    SCALED,
    Choice,
    LogUniform,
    Uniform,
    factor_name,
    is_number,
    key_of,
    read_draw,
    shown,
    with_keys,
)
from colibri.campaigns.flights import Common, FlightResult, Verdict, check, common_of
from colibri.common.errors import Error, unknown
from colibri.common.files import read_text
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


Range: TypeAlias = Uniform | Integers | Choice


def read_range(key: str, given: Any) -> Range:
    """Read a range such as `{ log-uniform = [2, 20] }`."""
    kind = next(iter(given)) if isinstance(given, dict) and len(given) == 1 else None
    if kind not in _KINDS:
        raise TuningError(f"{key}: expected one of {', '.join(_KINDS)}, as in {{ uniform = [2, 20] }}, not {given}")
    if kind != "integers":
        read = read_draw(key, given)
        assert isinstance(read, Uniform | Choice), "normal is not among the kinds"
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
    if not isinstance(values, Uniform):
        return value
    return min(max(float(f"{value:.{_DIGITS}g}"), values.low), values.high)


def as_flown(values: Range, value: Any) -> Any:
    if isinstance(values, Choice):
        return next(each for each in values.values if shown(each) == value)
    return value


SHARE_LOST = "share_lost"
LOST_COUNTS = 10.0  # a lost flight counts this many times the largest original value
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


_MIN_SEEDS = 3


class TuningTables(FlightTables, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The tables of a tuning's file; also the keywords of `colibri.tune`.

    Attributes:
        prune_after: Seeds between decisions to end a trial clearly worse than the best; 0 never. Default a quarter of
            the seeds, at least three.
        objectives: Metrics to minimize, and how to pool them over a trial's flights.
    """

    FACTORS: ClassVar[tuple[str, ...]] = (*FlightTables.FACTORS, "tune")
    name: str = "tuning"
    seeds: Any = "0-7"
    check_seeds: Any = None  # seeds to compare the best profile with the original by
    trials: int = 50  # number of trials, including the original profile
    prune_after: int | None = None
    tune: dict[str, Any] = msgspec.field(default_factory=dict)  # numbers of the profile and their ranges
    objectives: dict[str, Any] = msgspec.field(default_factory=dict)


class Tuning(NamedTuple):
    """A validated tuning; `base` is the original profile, `text` its file."""

    campaign: Campaign
    common: Common
    check_seeds: Sequence[int]
    trials: int
    prune_after: int
    space: dict[str, Range]
    objectives: tuple[Objective, ...]
    base: Profile
    text: str | None

    @property
    def begins(self) -> dict[str, Any]:
        """The original values, for Optuna."""
        had = {name: _had(self.base, name) for name in self.space}
        return {name: shown(had[name]) if isinstance(it, Choice) else had[name] for name, it in self.space.items()}

    def tuned(self, params: Mapping[str, Any]) -> Profile:
        profile: Profile = with_keys(self.flown(params), "profile", self.base)
        return profile

    def flown(self, params: Mapping[str, Any]) -> dict[str, Any]:
        return {name: as_flown(self.space[name], value) for name, value in params.items()}

    def steps(self) -> list[list[Point]]:
        """Return a trial's flights in steps, between which it may be pruned."""
        seeds = self.campaign.seeds
        by_seed: dict[int, list[Point]] = {seed: [] for seed in seeds}
        for point in self.campaign.points():
            by_seed[point.seed].append(point)
        size = self.prune_after or len(seeds)
        return [
            [point for seed in seeds[first : first + size] for point in by_seed[seed]]
            for first in range(0, len(seeds), size)
        ]


def tuning_of(tables: TuningTables) -> Tuning:
    """Read a tuning; flights at the ends of all ranges are planned to find errors early."""
    space = _space(tables)
    campaign = campaign_of(
        CampaignTables(**{table: getattr(tables, table) for table in FlightTables.__struct_fields__})
    )
    if campaign.flights > MAX_UNASKED:
        raise TuningError(f"seeds: {campaign.flights} flights a trial exceed the limit of {MAX_UNASKED}")
    _check_factors(campaign, space)
    objectives = read_objectives(tables.objectives, campaign.metrics)
    campaign = campaign._replace(metrics=metrics_of(objectives, campaign.metrics))
    common = common_of(campaign)
    given = campaign.fly.get("profile") or "flight"
    base = common.profiles[given] if isinstance(given, str) else given
    for name, values in space.items():
        check_holds(name, values, _had(base, name))
    tuning = Tuning(
        campaign=campaign,
        common=common,
        check_seeds=_check_seeds(tables.check_seeds, campaign.seeds),
        trials=_at_least(tables.trials, 2, "trials"),
        prune_after=_prune_after(tables.prune_after, len(campaign.seeds), len(objectives)),
        space=space,
        objectives=objectives,
        base=base,
        text=_text(given),
    )
    _check_ends(tuning)
    return tuning


def _space(tables: TuningTables) -> dict[str, Range]:
    space: dict[str, Range] = {}
    for given, values in tables.tune.items():
        name = factor_name(given)
        key = key_of(name)
        if key is None or key.table != "profile":
            raise TuningError(f"tune: {given} is not a number of a profile: give controllers.LAW.KEY")
        if any(name.rstrip(SCALED) == other.rstrip(SCALED) for other in space):
            raise TuningError(f"tune: {name.rstrip(SCALED)} is given twice")
        space[name] = read_range(name, values)
    if not space:
        raise TuningError(
            'tune: at least one number is required, for example "controllers.LAW.KEY" = { uniform = [2, 20] }'
        )
    return space


def _had(base: Profile, name: str) -> Any:
    key = key_of(name)
    assert key is not None, "a tuned number is a key"
    had = base.value(key.key)
    return 1.0 if key.scaled else had


def _check_factors(campaign: Campaign, space: Mapping[str, Range]) -> None:
    varied = {name for point in campaign.samples() for name in point.settings}
    plain = {name.rstrip(SCALED) for name in (*campaign.fly, *varied)}
    for twice in (name for name in space if name.rstrip(SCALED) in plain):
        raise TuningError(f"{twice} is given twice: remove it from fly, grid or draw")
    if "profile" in varied:
        raise TuningError("profile: only one can be tuned: set it in fly")


def _check_seeds(given: Any, seeds: Sequence[int]) -> Sequence[int]:
    if given is None:
        return ()
    try:
        checked = read_seeds(given)
    except Error as error:
        raise TuningError(f"check_{error}") from error
    if len(checked) < 2:
        raise TuningError("check_seeds: one seed gives no interval: give more, for example 101-150")
    seen = sorted({*checked} & {*seeds})
    if seen:
        raise TuningError(f"check_seeds: {seen[0]} is among seeds: tuning must never have seen those it is checked by")
    return checked


def _prune_after(given: int | None, seeds: int, objectives: int) -> int:
    if given is None:
        after = max(_MIN_SEEDS, ceil(seeds / 4)) if objectives == 1 else 0
        return after if after < seeds else 0
    if objectives > 1 and given:
        raise TuningError("prune_after: with several objectives no trial is worse before its end: leave it out")
    return _at_least(given, 0, "prune_after")


def _at_least(value: int, least: int, called: str) -> int:
    if value < least:
        raise TuningError(f"{called}: must be at least {least}, not {value}")
    return value


def _text(given: Any) -> str | None:
    if not isinstance(given, str):
        return None
    return read_text(Path(given)) if given.endswith(".toml") else profile_text(given)


def _check_ends(tuning: Tuning) -> None:
    campaign, common = tuning.campaign, tuning.common
    check(campaign.samples(), common)
    first = campaign._replace(grid={name: values[:1] for name, values in campaign.grid.items()}, draw={})
    drawn = {name: draw.typical[0] for name, draw in campaign.draw.items()}
    for name, values in tuning.space.items():
        for value in values.typical:
            try:
                check(first.samples(), common._replace(fly={**common.fly, **drawn, name: value}))
            except Error as error:
                raise TuningError(f"{name} = {value}: {error}") from error
