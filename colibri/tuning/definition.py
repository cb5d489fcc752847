"""A tuning as data."""

from collections.abc import Mapping, Sequence
from math import ceil
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import msgspec

from colibri.autopilot.control.profile import Profile, profile_text
from colibri.campaigns.definition import (
    MAX_UNASKED,
    Campaign,
    CampaignTables,
    FlightTables,
    Point,
    campaign_of,
    read_seeds,
)
from colibri.campaigns.factors import SCALED, factor_name, key_of, with_keys
from colibri.campaigns.flights import Common, check, common_of
from colibri.common.errors import Error
from colibri.common.files import read_text
from colibri.tuning.space import (
    Objective,
    Range,
    TuningError,
    as_flown,
    as_optuna,
    check_holds,
    metrics_of,
    read_objectives,
    read_range,
)

_MIN_SEEDS = 3


class TuningTables(FlightTables, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The tables of a tuning's file; also the keywords of `colibri.tune`.

    Attributes:
        check_seeds: Seeds to compare the best profile with the original by.
        trials: Number of trials, including the original profile.
        prune_after: Seeds between decisions to end a trial clearly worse than the best; 0 never. Default a quarter of
            the seeds, at least three.
        tune: Numbers of the profile and their ranges.
        objectives: Metrics to minimize, and how to pool them over a trial's flights.
    """

    FACTORS: ClassVar[tuple[str, ...]] = (*FlightTables.FACTORS, "tune")
    name: str = "tuning"
    seeds: Any = "0-7"
    check_seeds: Any = None
    trials: int = 50
    prune_after: int | None = None
    tune: dict[str, Any] = msgspec.field(default_factory=dict)
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
        return {name: as_optuna(values, _had(self.base, name)) for name, values in self.space.items()}

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
        raise TuningError('tune: no numbers: add for example "controllers.LAW.KEY" = { uniform = [2, 20] }')
    return space


def _had(base: Profile, name: str) -> Any:
    key = key_of(name)
    if key is None:
        raise KeyError(name)
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
