"""`colibri.tune`: fly trials, then compare on other seeds."""

from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from types import NoneType
from typing import Any

import msgspec

from colibri.campaigns.definition import tables_of
from colibri.campaigns.engines.pool import Engine
from colibri.campaigns.flights import FlightResult
from colibri.campaigns.journal import claim, identity_of
from colibri.campaigns.results import CampaignResults
from colibri.campaigns.run import engine_of, fly_campaign
from colibri.common.errors import checked
from colibri.tuning.definition import Tuning, TuningTables, tuning_of
from colibri.tuning.flying import TrialFlights, fly_trial, scale_kept
from colibri.tuning.results import TuningResults, tuned_name
from colibri.tuning.space import TuningError
from colibri.tuning.trials import FileLock, Trials, require_optuna
from colibri.tuning.verdict import check_campaign

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

    Raises:
        Error: An input is invalid.
    """
    require_optuna()
    tuning = tuning_of(tables_of(TuningTables, file, tables))
    checked("out", out, (str, PurePath, NoneType), "a folder", TuningError)
    if out is not None:
        return fly_tuning(tuning, lambda: engine_of(workers, executor), Path(out), resume=resume, watcher=watcher)
    with TemporaryDirectory(prefix="colibri-") as folder:
        return fly_tuning(
            tuning, lambda: engine_of(workers, executor), Path(folder) / "tune", watcher=watcher, keep=False
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
            scale = scale_kept(ended[0]) if begun.number else None
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
