"""`colibri.tune`: fly trials, unless they are clearly worse than the best, then compare on other seeds."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from importlib.metadata import version
from itertools import islice
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from types import NoneType
from typing import Any, NamedTuple, Self

import msgspec
import numpy as np

from colibri.campaigns.definition import Point, tables_of
from colibri.campaigns.engines import Engine
from colibri.campaigns.flights import Common, FlightResult, Verdict, fly_points
from colibri.campaigns.journal import claim, identity_of
from colibri.campaigns.results import CampaignResults
from colibri.campaigns.run import engine_of, fly_campaign
from colibri.common.errors import checked
from colibri.common.types import Array
from colibri.tuning.definition import Tuning, TuningError, TuningTables, tuning_of
from colibri.tuning.results import TuningResults, check_campaign, tuned_name
from colibri.tuning.trials import Begun, FileLock, FinishedTrial, Trials, require_optuna

_WORST, _EACH = "worst", "each"


class Scale(NamedTuple):
    """The original profile's values by objective: of a lost flight, and of each."""

    worst: tuple[float, ...]
    each: tuple[tuple[float, ...], ...]


class TrialFlights(AbstractContextManager["TrialFlights"]):
    """Flies with an engine that is kept between trials; iterates over its jobs."""

    def __init__(self, engine: Engine, common: Common) -> None:
        self._left: deque[Point] = deque()
        self._flown = fly_points(self, common, engine)

    def fly(self, points: Sequence[Point]) -> list[FlightResult]:
        self._left.extend(points)
        found = {flown.flight: flown for flown in islice(self._flown, len(points))}
        return [found[point.flight] for point in points]

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> Point:
        if not self._left:
            raise StopIteration
        return self._left.popleft()

    def __exit__(self, *_error: object) -> None:
        self._flown.close()


def fly_trial(
    tuning: Tuning,
    begun: Begun,
    flights: TrialFlights,
    scale: Scale | None,
    best: float,
    progress: Callable[[FlightResult], object],
) -> FinishedTrial:
    """Fly a trial; `scale` is `None` in the original's, a pruned one counts at least the `best` value."""
    factors = tuning.flown(begun.params)
    flown: list[FlightResult] = []
    counts: list[Array] = []
    for points in tuning.steps():
        some = flights.fly([point._replace(factors=point.factors | factors) for point in points])
        flown += some
        for each in some:
            progress(each)
        if scale is not None:
            counts = _counts(tuning, flown, scale.worst)
            if _is_pruned(tuning, begun, counts[0], len(some)):
                return _ended(begun, flown, (max(best, _expected(tuning, counts[0], scale)),), pruned=True)
    if scale is None:
        scale = scale_of(tuning, flown)
        counts = _counts(tuning, flown, scale.worst)
        _is_pruned(tuning, begun, counts[0], len(flown))
    pooled = (float(objective.pooled(each)) for objective, each in zip(tuning.objectives, counts, strict=True))
    return _ended(begun, flown, tuple(pooled), scale=scale if begun.number == 0 else None)


def scale_of(tuning: Tuning, flown: Sequence[FlightResult]) -> Scale:
    """Return the reference values; TuningError without a metric."""
    refused = next((each for each in flown if each.verdict is Verdict.REFUSED), None)
    if refused is not None:
        raise TuningError(refused.why)
    worst = tuple(objective.worst(flown, tuning.campaign.metrics) for objective in tuning.objectives)
    return Scale(worst, tuple(tuple(each.tolist()) for each in _counts(tuning, flown, worst)))


def _counts(tuning: Tuning, flown: Sequence[FlightResult], worst: Sequence[float]) -> list[Array]:
    metrics = tuning.campaign.metrics
    return [
        objective.of_flights(flown, metrics, at_most)
        for objective, at_most in zip(tuning.objectives, worst, strict=True)
    ]


def _is_pruned(tuning: Tuning, begun: Begun, counts: Array, new: int) -> bool:
    if not tuning.prune_after:
        return False
    for place in range(len(counts) - new, len(counts)):
        begun.trial.report(float(counts[place]), place)
    return len(counts) < tuning.campaign.flights and begun.trial.should_prune()


def _expected(tuning: Tuning, counts: Array, scale: Scale) -> float:
    (objective,) = tuning.objectives
    whole = np.array(scale.each[0])
    pooled, same = objective.pooled(counts), objective.pooled(whole[: len(counts)])
    return float(pooled * (objective.pooled(whole) / same if same else 1.0))


def _ended(
    begun: Begun,
    flown: Sequence[FlightResult],
    values: tuple[float, ...],
    *,
    pruned: bool = False,
    scale: Scale | None = None,
) -> FinishedTrial:
    lost = sum(each.verdict is not Verdict.FLOWN for each in flown)
    kept: Mapping[str, Any] = {} if scale is None else {_WORST: list(scale.worst), _EACH: list(map(list, scale.each))}
    return FinishedTrial(begun.number, values, begun.params, len(flown), lost, pruned, kept)


IDENTITY = "tuning.json"


class Watcher:
    def began(self, trials: int) -> None: ...

    def flown(self, flown: FlightResult) -> None: ...

    def ended(self, trials: int, first: float, best: float) -> None:
        """Update progress; `first` and `best` are first objectives."""

    def checking(self, flights: int) -> None: ...


def tune(
    file: str | Path | None = None,
    *,
    out: str | Path | None = None,
    workers: int | None = None,
    executor: Any = None,
    resume: bool = False,
    watcher: Watcher | None = None,
    **tables: Any,
) -> TuningResults:
    """Tune numbers of a profile.

    Args:
        file: TOML file of the tuning; keywords take precedence.
        out: Folder for profile, tables, figures and journal; by default no files are written.
        workers, executor: As in `campaign`.
        resume: Continue the tuning in `out`, or join running processes.
        watcher: Progress callbacks.
        tables: As in the file: `tune={"controllers.LAW.KEY": {"uniform": [2, 20]}}, objectives={"rmse_m": "mean"},
            fly={...}, grid={...}, draw={...}, seeds="1-8", check_seeds="101-150"`, `trials`, `prune_after`, `metrics`,
            `name`, `root_seed`. Values may be objects, as in `colibri.fly`; metrics may be functions of a `Flight`.
    """
    require_optuna()
    tuning = tuning_of(tables_of(TuningTables, file, tables))
    checked("out", out, (str, PurePath, NoneType), "a folder", TuningError)
    with TemporaryDirectory(prefix="colibri-") as own:
        folder, keep = Path(own) / "tune" if out is None else Path(out), out is not None
        return fly_tuning(
            tuning, lambda: engine_of(workers, executor), folder, resume=resume, watcher=watcher, keep=keep
        )


def fly_tuning(
    tuning: Tuning,
    engine: Callable[[], Engine],
    out: Path,
    *,
    resume: bool = False,
    watcher: Watcher | None = None,
    keep: bool = True,
) -> TuningResults:
    """Fly the trials missing in `out`, and write the results unless `keep` is off."""
    told = watcher or Watcher()
    first_engine = engine()
    _open(out, tuning, resume=resume)
    with Trials(out, tuning) as trials:
        _fly_trials(tuning, trials, first_engine, told)
        results = TuningResults(tuning, trials.ended, trials.importances())
        with FileLock(out / "locks" / "results"):
            if keep:
                results.save(out)
            if tuning.check_seeds and results.best.number:
                results.add_check(_check(tuning, results, engine(), out, told))
                if keep:
                    results.save_verdict(out)
    return results


def _fly_trials(tuning: Tuning, trials: Trials, engine: Engine, told: Watcher) -> None:
    told.began(tuning.trials)
    with TrialFlights(engine, tuning.common) as flights:
        while (begun := trials.ask()) is not None:
            ended = trials.ended
            kept = ended[0].attributes if begun.number else {}
            scale = Scale(tuple(kept[_WORST]), tuple(map(tuple, kept[_EACH]))) if kept else None
            best = min((trial.values[0] for trial in ended), default=0.0)
            trials.tell(begun, fly_trial(tuning, begun, flights, scale, best, told.flown))
            values = [trial.values[0] for trial in trials.ended]
            told.ended(len(values), values[0], min(values))


def _check(tuning: Tuning, results: TuningResults, engine: Engine, out: Path, told: Watcher) -> CampaignResults:
    after = msgspec.structs.replace(results.profile, name=tuned_name(tuning.base))
    campaign = check_campaign(tuning, tuning.base, after)
    told.checking(campaign.flights)
    folder = out / "check" / f"trial-{results.best.number}"
    return fly_campaign(campaign, engine, folder, resume=True, yes=True, progress=told.flown)


def _open(out: Path, tuning: Tuning, *, resume: bool) -> None:
    try:
        out.mkdir(parents=True, exist_ok=True)
        with FileLock(out):
            there = claim(out / IDENTITY, _identity(tuning), "tuning")
    except OSError as error:
        raise TuningError(f"cannot use --out {out}: {error}") from error
    if there and not resume:
        raise TuningError(f"--out {out} has this tuning already: continue with --resume, or choose another folder")


def _identity(tuning: Tuning) -> dict[str, Any]:
    return {
        **identity_of(tuning.campaign, tuning.common),
        "optuna": version("optuna"),
        "check_seeds": list(tuning.check_seeds),
        "prune_after": tuning.prune_after,
        "tune": {name: [type(values).__name__, repr(values)] for name, values in tuning.space.items()},
        "objectives": [objective.name for objective in tuning.objectives],
    }
