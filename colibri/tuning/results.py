"""The results of a tuning."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import msgspec
import numpy as np
from numpy.random import PCG64, Generator, SeedSequence

from colibri.analysis.tables import Row, comma_separated
from colibri.autopilot.control.profile import Profile, ProfileTables
from colibri.campaigns.definition import Campaign
from colibri.campaigns.factors import key_of, shown
from colibri.campaigns.flight_table import FlightTable
from colibri.campaigns.flights import FlightResult
from colibri.campaigns.results import CampaignResults
from colibri.common.errors import unknown
from colibri.common.types import Array
from colibri.tuning.definition import SHARE_LOST, Objective, Tuning, TuningError, value_of
from colibri.tuning.trials import FinishedTrial

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HEADINGS: Row = ("what", "flights of", "seeds", "before", "after", "change", "change, low", "change, high")
ALL = "all"  # all combinations of the grid
_RESAMPLES = 10_000
_CONFIDENCE = (0.025, 0.975)
_STREAM = 1  # random stream of the bootstrap


class Compared(NamedTuple):
    """One number before and after, for one combination or `all`."""

    what: str
    where: str
    seeds: int
    before: float
    after: float
    change: float  # relative to `before`; absolute for a share, or if a resampled `before` is zero
    low: float  # bounds at 95 % confidence: bootstrap over seeds, in pairs
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


def profile_file(base: Profile, text: str | None, tuned: Profile, factors: Sequence[str], origin: Sequence[str]) -> str:
    """Return the file of a tuned profile; `text` is that of `base`, `origin` its first comment."""
    import tomlkit

    document: Any = tomlkit.parse(text) if text is not None else tomlkit.parse(tomlkit.dumps(_tables(base)))
    name = tuned_name(base)
    if "name" in document:
        document["name"] = name
    else:
        text = f'name = "{name}"\n{tomlkit.dumps(document)}'
        document = tomlkit.parse(text)
    lines = [*origin, "Tuned numbers, with their original values:"]
    for factor in factors:
        key = key_of(factor)
        assert key is not None, "a tuned number is a key"
        was, now = (profile.value(key.key) for profile in (base, tuned))
        _set(document, key.key, now)
        lines.append(f"  {key.key} = {now}  # {was}")
    written = "".join(f"# {line}\n" for line in lines) + tomlkit.dumps(document)
    _check(written, tuned, name)
    return written


def tuned_name(base: Profile) -> str:
    return f"{base.name.rstrip('*')}-tuned"


def _set(document: Any, key: str, value: Any) -> None:
    *above, last = key.split(".")
    parent = document
    for name in above:
        parent = parent[int(name) if isinstance(parent, list) else name]
    parent[int(last) if isinstance(parent, list) else last] = value


def _tables(profile: Profile) -> Mapping[str, Any]:
    plain = msgspec.to_builtins(profile)
    return {key: _given(plain[key]) for key in ProfileTables.__struct_fields__ if plain[key] is not None}


def _given(value: Any) -> Any:
    """Remove `None`, which TOML does not have."""
    return {key: _given(each) for key, each in value.items() if each is not None} if isinstance(value, dict) else value


def _check(written: str, tuned: Profile, name: str) -> None:
    expected = msgspec.convert({**_tables(tuned), "name": name}, type=ProfileTables)
    if msgspec.toml.decode(written, type=ProfileTables) != expected:
        raise AssertionError("the profile that was written is not the one that was flown")


PROFILE = "profile.toml"


class TuningResults:
    """The results of a tuning.

    Attributes:
        trials: Finished trials by number; the first is the original profile.
        best: Trial with the least objective; with several, that on the Pareto front nearest to all minima, relative to
            the front's ranges.
        front: Pareto front.
        importances: Relative importance of each number by objective (PED-ANOVA); empty below eight trials.
        profile: The tuned profile.
        checked: Flights of both profiles with `check_seeds`, if there are any.
        verdict: Comparison of both; empty without them.
    """

    def __init__(
        self, tuning: Tuning, trials: Sequence[FinishedTrial], importances: Sequence[dict[str, float]]
    ) -> None:
        self.tuning = tuning
        self.trials = list(trials)
        names = [objective.name for objective in tuning.objectives]
        self.importances = dict(zip(names, importances, strict=False))
        self.front = _front([trial for trial in self.trials if not trial.pruned])
        self.best = _chosen(self.front)
        self.profile: Profile = tuning.tuned(self.best.params)
        self.checked: CampaignResults | None = None
        self.verdict: list[Compared] = []

    def add_check(self, checked: CampaignResults) -> None:
        self.checked = checked
        self.verdict = compare(self.tuning, checked)

    @property
    def is_better(self) -> bool:
        """Whether some objective is better with 95 % confidence on `check_seeds`, without a worse one."""
        return better(self.verdict)

    @property
    def profile_text(self) -> str:
        """The file of the tuned profile, with its origin as a comment."""
        return self.file_of(self.best)

    def file_of(self, trial: FinishedTrial) -> str:
        from importlib.metadata import version

        tuning, first = self.tuning, self.trials[0]
        campaign = tuning.campaign
        flown = ", ".join(f"{name} {shown(value)}" for name, value in {**campaign.fly, **campaign.grid}.items())
        drawn = ", ".join(campaign.draw)
        values = zip(tuning.objectives, first.values, trial.values, strict=True)
        origin = [
            f"Profile {tuning.base.name}, tuned by `colibri tune` {version('colibri-sitl')}: trial {trial.number} of "
            f"{len(self.trials)} of {campaign.name}.",
            f"Flown: {flown}; seeds {_span(campaign.seeds)}{'; drawn: ' + drawn if drawn else ''}.",
            *(f"{objective.name}: {before:.4g} before, {after:.4g} after." for objective, before, after in values),
        ]
        profile = tuning.tuned(trial.params)
        return profile_file(tuning.base, tuning.text, profile, list(tuning.space), origin)

    @property
    def headings(self) -> Row:
        objectives = (objective.name for objective in self.tuning.objectives)
        return ("trial", "state", "flights", "lost", *objectives, *self.tuning.space)

    def rows(self) -> list[Row]:
        """Return the table of trials; numbers with ten digits."""
        rows: list[Row] = []
        for trial in self.trials:
            head = (str(trial.number), self._state(trial), str(trial.flights), str(trial.lost))
            params = (str(trial.params[name]) for name in self.tuning.space)
            rows.append((*head, *(f"{value:.10g}" for value in trial.values), *params))
        return rows

    def plot(self, what: str = "importance") -> "Figure":
        """Return a figure: history, slices, from eight trials on importance, with several objectives pareto."""
        figures = self._figures()
        if what not in figures:
            raise TuningError(unknown("figure of these trials", what, figures))
        return figures[what]()

    def save(self, folder: str | Path) -> Path:
        """Write profile, tables and figures; return the folder."""
        path = Path(folder)
        path.mkdir(parents=True, exist_ok=True)
        (path / PROFILE).write_text(self.profile_text, encoding="utf-8")
        (path / "trials.csv").write_text(comma_separated(self.headings, self.rows()), encoding="utf-8")
        if len(self.tuning.objectives) > 1:
            (path / "pareto").mkdir(exist_ok=True)
            for trial in self.front:
                (path / "pareto" / f"trial-{trial.number}.toml").write_text(self.file_of(trial), encoding="utf-8")
        if self.verdict:
            self.save_verdict(path)
        for name, draw in self._figures().items():
            draw().savefig(path / f"{name}.png")
        return path

    def save_verdict(self, folder: Path) -> None:
        rows = [each.row for each in self.verdict]
        (folder / "verdict.csv").write_text(comma_separated(HEADINGS, rows), encoding="utf-8")

    def _state(self, trial: FinishedTrial) -> str:
        if trial is self.best:
            return "chosen"
        if trial.pruned:
            return "pruned"
        return "front" if len(self.tuning.objectives) > 1 and trial in self.front else "flown"

    def _figures(self) -> "dict[str, Callable[[], Figure]]":
        from colibri.tuning.figures import draw_history, draw_importance, draw_pareto, draw_slices

        tuning, trials, best = self.tuning, self.trials, self.best
        names = [objective.name for objective in tuning.objectives]
        title = f"{tuning.campaign.name}: {len(trials)} trials"
        found: dict[str, Callable[[], Figure]] = {
            "history": partial(draw_history, title, names, trials, best),
            "slices": partial(draw_slices, title, tuning.space, names[0], trials, best),
        }
        if self.importances:
            found["importance"] = partial(draw_importance, title, self.importances)
        if len(names) > 1:
            found["pareto"] = partial(draw_pareto, title, names, trials, self.front, best)
        return found


def _front(trials: Sequence[FinishedTrial]) -> list[FinishedTrial]:
    front: list[FinishedTrial] = []
    for trial in sorted(trials, key=lambda trial: (trial.values, trial.number)):
        if not any(all(a <= b for a, b in zip(other.values, trial.values, strict=True)) for other in front):
            front.append(trial)
    return sorted(front, key=lambda trial: trial.number)


def _chosen(front: Sequence[FinishedTrial]) -> FinishedTrial:
    least = [min(values) for values in zip(*(trial.values for trial in front), strict=True)]
    most = [max(values) for values in zip(*(trial.values for trial in front), strict=True)]

    def distance(trial: FinishedTrial) -> float:
        ranges = zip(trial.values, least, most, strict=True)
        parts = [(value - low) / (high - low) for value, low, high in ranges if high > low]
        return sum((part * part for part in parts), 0.0)

    return min(front, key=distance)


def _span(seeds: Sequence[int]) -> str:
    if len(seeds) > 1 and list(seeds) == list(range(seeds[0], seeds[-1] + 1)):
        return f"{seeds[0]}-{seeds[-1]}"
    return " ".join(map(str, seeds))
