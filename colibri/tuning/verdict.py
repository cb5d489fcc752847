"""Compare a tuned profile with its original on other seeds, in pairs."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.random import PCG64, Generator, SeedSequence

from colibri.analysis.tables import Row
from colibri.autopilot.control.profile import Profile
from colibri.campaigns.definition import Campaign
from colibri.campaigns.factors import shown
from colibri.campaigns.flight_table import FlightTable
from colibri.campaigns.flights import FlightResult
from colibri.common.types import Array
from colibri.tuning.definition import Tuning
from colibri.tuning.space import SHARE_LOST, Objective, value_of

HEADINGS: Row = ("what", "flights of", "seeds", "before", "after", "change", "change, low", "change, high")
ALL = "all"
"""All combinations of the grid."""
_RESAMPLES = 10_000
_CONFIDENCE = (0.025, 0.975)
_STREAM = 1
"""Random stream of the bootstrap."""


class Compared(NamedTuple):
    """One number before and after, for one combination or `all`.

    Attributes:
        change: Relative to `before`; absolute for a share, or if a resampled `before` is zero.
        low, high: Bounds at 95 % confidence: bootstrap over seeds, in pairs.
    """

    what: str
    where: str
    seeds: int
    before: float
    after: float
    change: float
    low: float
    high: float
    is_relative: bool
    is_objective: bool

    @property
    def is_overall(self) -> bool:
        return self.where == ALL

    @property
    def changes(self) -> Row:
        """The change and its interval as texts, in percent if relative or a share."""
        percent = self.is_relative or self.what == SHARE_LOST
        numbers = (self.change, self.low, self.high)
        change, low, high = (f"{100.0 * x:+.1f} %" if percent else f"{x:+.4g}" for x in numbers)
        return change, f"{low} to {high}"

    @property
    def row(self) -> Row:
        numbers = (self.before, self.after, self.change, self.low, self.high)
        return (self.what, self.where, str(self.seeds), *(f"{number:.6g}" for number in numbers))


def check_campaign(tuning: Tuning, before: Profile, after: Profile) -> Campaign:
    """Return the campaign of both profiles with `check_seeds` and other draws."""
    campaign = tuning.campaign
    return campaign._replace(
        name=f"{campaign.name}: check",
        seeds=tuning.check_seeds,
        root_seed=campaign.root_seed + 1,
        paired=True,
        fly={name: value for name, value in campaign.fly.items() if name != "profile"},
        grid={"profile": (before, after), **campaign.grid},
    )


def compare(tuning: Tuning, table: FlightTable) -> list[Compared]:
    pairs = _Pairs(table)
    others = [metric.name for metric in table.campaign.metrics]
    wanted = {objective.metric for objective in tuning.objectives}
    means = [Objective(name) for name in others if name not in wanted]
    means += [] if SHARE_LOST in wanted else [Objective(SHARE_LOST)]
    found = [each for objective in tuning.objectives for each in pairs.compared(objective, is_objective=True)]
    return found + [each for objective in means for each in pairs.compared(objective, is_objective=False)]


class _Pairs:
    def __init__(self, table: FlightTable) -> None:
        self._campaign = table.campaign
        self._seeds = len(table.campaign.seeds)
        combinations = table.campaign.combinations // 2
        flown = np.empty(len(table.flown), dtype=object)
        flown[:] = table.flown
        self._flown = flown.reshape(2, combinations, self._seeds)
        points = list(table.campaign.points())[: combinations * self._seeds : self._seeds]
        several = [name for name, values in table.campaign.grid.items() if len(values) > 1 and name != "profile"]
        self._names = [", ".join(shown(point.factors[name]) for name in several) for point in points]

    def compared(self, objective: Objective, *, is_objective: bool) -> Iterator[Compared]:
        counts = self._counts(objective, penalised=is_objective)
        each = zip(self._names, np.moveaxis(counts, 1, 0), strict=True) if len(self._names) > 1 else ()
        for where, some in ((ALL, counts), *each):
            if not np.isnan(some).all():
                yield _compared(objective, where, some.reshape(2, -1, self._seeds), is_objective=is_objective)

    def _counts(self, objective: Objective, *, penalised: bool) -> Array:
        """Return values, (2, combinations, seeds); unless penalised, pairs with a lost flight are nan."""
        metrics = self._campaign.metrics
        if penalised or objective.metric == SHARE_LOST:
            worst = objective.worst(self._listed(0), metrics)
            return np.array([objective.of_flights(self._listed(of), metrics, worst) for of in (0, 1)]).reshape(
                self._flown.shape
            )
        place = [metric.name for metric in metrics].index(objective.metric)
        values = np.array([value_of(each, place, np.nan) for of in (0, 1) for each in self._listed(of)])
        found: Array = values.reshape(self._flown.shape)
        found[:, np.isnan(found).any(axis=0)] = np.nan
        return found

    def _listed(self, of: int) -> list[FlightResult]:
        return list(self._flown[of].ravel())


def _compared(objective: Objective, where: str, counts: Array, *, is_objective: bool) -> Compared:
    """Compare values, (2, combinations, seeds), and resample the seeds."""
    whole = np.moveaxis(counts, -1, 1)  # (2, seeds, combinations)
    seeds = whole.shape[1]
    chance = Generator(PCG64(SeedSequence(0, spawn_key=(_STREAM,))))
    places = np.vstack((np.arange(seeds), chance.integers(seeds, size=(_RESAMPLES, seeds))))
    before, after = (_pooled(objective, each[places].reshape(len(places), -1)) for each in whole)
    relative = objective.metric != SHARE_LOST and bool((before != 0.0).all())
    change = (after - before) / (np.abs(before) if relative else 1.0)
    low, high = np.nanquantile(change[1:], _CONFIDENCE)
    numbers = (float(before[0]), float(after[0]), float(change[0]), float(low), float(high))
    return Compared(objective.name, where, seeds, *numbers, relative, is_objective)


def _pooled(objective: Objective, counts: Array) -> Array:
    if not np.isnan(counts).any():
        pooled: Array = objective.pooled(counts)
        return pooled
    return np.array([objective.pooled(row[~np.isnan(row)]) if not np.isnan(row).all() else np.nan for row in counts])


def better(compared: Sequence[Compared]) -> bool:
    found = [each for each in compared if each.is_objective and each.is_overall]
    return any(each.high < 0.0 for each in found) and not any(each.low > 0.0 for each in found)
