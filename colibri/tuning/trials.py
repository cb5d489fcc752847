"""The trials of a tuning: Optuna's, in a journal that several processes write to and that outlives each of them."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import sleep
from typing import TYPE_CHECKING, Any, NamedTuple, Self, cast
from warnings import catch_warnings, simplefilter

from numpy.random import SeedSequence

from colibri.tuning.file_lock import FileLock, JournalLock
from colibri.tuning.space import TuningError, as_tried, distribution

if TYPE_CHECKING:
    from optuna import Study, Trial
    from optuna.trial import FrozenTrial

    from colibri.tuning.definition import Tuning

_PACKAGE = "colibri-sitl"
JOURNAL, _LOCKS = "trials.log", "locks"
_NUMBER, _PROCESS, _FLIGHTS, _LOST, _PRUNED = "number", "process", "flights", "lost", "pruned"
_POLL_S = 0.2
_MAX_P = 0.05
"""A trial ends early where it is worse than the best with less than this chance of that being chance."""
_BEST_PART, _MIN_TRIALS = 0.25, 8


class Ended(NamedTuple):
    """A trial that has ended.

    Attributes:
        number: Its place; 0 is the profile as it is.
        values: Of the objectives; of a pruned trial what they would probably have been.
        params: What was tried.
        flights: How many it flew.
        lost: How many of them were lost.
        pruned: Whether it ended early.
        attributes: What else was kept.
    """

    number: int
    values: tuple[float, ...]
    params: dict[str, Any]
    flights: int
    lost: int
    pruned: bool
    attributes: Mapping[str, Any]


class Begun(NamedTuple):
    """A trial to be flown: its number, what is tried, and Optuna's part of it."""

    number: int
    params: dict[str, Any]
    trial: "Trial"


class Trials:
    """The trials of a tuning in a folder, shared by all processes that are at it.

    A process has a place, by a lock that ends with it, so that the others know which trials nobody flies any more. What
    the next trial tries follows from the trials that have ended, its number and the root seed: a process that goes on
    after another's end goes on as that would have.
    """

    def __init__(self, folder: Path, tuning: "Tuning") -> None:
        """Go on with the trials in `folder`, or begin.

        Raises:
            TuningError: Optuna is not installed.
        """
        optuna = require_optuna()
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        self._tuning = tuning
        self._space = {name: distribution(values) for name, values in tuning.space.items()}
        self._folder = folder / _LOCKS
        self._folder.mkdir(parents=True, exist_ok=True)
        self._asking = FileLock(self._folder / "asking")
        self._place, self._held = self._take_place()
        journal = folder / JOURNAL
        backend = optuna.storages.journal.JournalFileBackend(str(journal), lock_obj=cast(Any, JournalLock(journal)))
        with self._asking, _unwarned():
            self._study: Study = optuna.create_study(
                storage=optuna.storages.JournalStorage(backend),
                study_name=tuning.campaign.name,
                directions=["minimize"] * len(tuning.objectives),
                pruner=optuna.pruners.WilcoxonPruner(p_threshold=_MAX_P) if tuning.prune_after else None,
                load_if_exists=True,
            )

    def __enter__(self) -> Self:
        """Begin."""
        return self

    def __exit__(self, *_error: object) -> None:
        """Leave: what this process has begun and not ended, another does again."""
        self._held.release()

    def ask(self) -> Begun | None:
        """Return the next trial; None when all have ended.

        It waits for the end of the first, which everything is measured by, and of those that others fly: they may die.
        """
        while True:
            with self._asking:
                self._give_up_abandoned()
                trials = self._trials()
                done = sum(trial.state.is_finished() for trial in trials)
                if len(trials) < self._tuning.trials and (not trials or trials[0].state.is_finished()):
                    return self._begin(trials)
            if done >= self._tuning.trials:
                return None
            sleep(_POLL_S)

    def tell(self, begun: Begun, ended: Ended) -> None:
        """Keep the end of a trial."""
        kept = {_FLIGHTS: ended.flights, _LOST: ended.lost, _PRUNED: ended.pruned, **ended.attributes}
        for name, value in kept.items():
            begun.trial.set_user_attr(name, value)
        self._study.tell(begun.trial, list(ended.values))

    @property
    def ended(self) -> list[Ended]:
        """The trials that have ended, by their numbers."""
        return [_ended(trial) for trial in self._trials() if trial.state.is_finished()]

    def importances(self) -> list[dict[str, float]]:
        """Return for each objective how much each number matters for being among the best trials, as parts of one.

        S. Watanabe, A. Bansal, F. Hutter, PED-ANOVA: Efficiently Quantifying Hyperparameter Importance in Arbitrary
        Subspaces, IJCAI 2023. Of the quarter of best trials, for a tenth of them would be too few.
        """
        from optuna.importance import PedAnovaImportanceEvaluator, get_param_importances

        ended = [trial for trial in self._trials() if trial.state.is_finished()]
        if len(ended) < _MIN_TRIALS:
            return []
        found = []
        for place in range(len(self._tuning.objectives)):
            study = self._study_of(ended, [place])
            with _unwarned():
                parts = get_param_importances(study, evaluator=PedAnovaImportanceEvaluator(target_quantile=_BEST_PART))
            found.append({name: float(parts[name]) for name in self._tuning.space})
        return found

    def _take_place(self) -> tuple[int, FileLock]:
        """Return the first place that no living process has, and the lock that keeps it."""
        place = 0
        while not (lock := FileLock(self._folder / f"process-{place}")).acquire(wait=False):
            place += 1
        return place, lock

    def _trials(self) -> list["FrozenTrial"]:
        """Return the trials that have ended, or will, by their numbers."""
        from optuna.trial import TrialState

        states = (TrialState.COMPLETE, TrialState.RUNNING)
        trials = self._study.get_trials(deepcopy=False, states=states)
        return sorted(trials, key=lambda trial: int(trial.user_attrs[_NUMBER]))

    def _give_up_abandoned(self) -> None:
        """Have those trials fail that no living process flies."""
        from optuna.trial import TrialState

        for trial in self._study.get_trials(deepcopy=False, states=(TrialState.RUNNING,)):
            place = trial.user_attrs.get(_PROCESS)
            if place is None or place == self._place or self._is_free(int(place)):
                self._study.tell(trial.number, state=TrialState.FAIL)

    def _is_free(self, place: int) -> bool:
        lock = FileLock(self._folder / f"process-{place}")
        try:
            return lock.acquire(wait=False)
        finally:
            lock.release()

    def _begin(self, trials: Sequence["FrozenTrial"]) -> Begun:
        """Begin the trial with the least number that there is not yet."""
        from optuna.trial import TrialState

        taken = {int(trial.user_attrs[_NUMBER]) for trial in trials}
        number = next(number for number in range(len(taken) + 1) if number not in taken)
        if not self._study.get_trials(deepcopy=False, states=(TrialState.WAITING,)):  # else one died before it asked
            params = self._next(trials, number) if number else self._tuning.begins
            self._study.enqueue_trial(params, user_attrs={_NUMBER: number})
        trial = self._study.ask(self._space)
        trial.set_user_attr(_PROCESS, self._place)
        return Begun(int(trial.user_attrs[_NUMBER]), trial.params, trial)

    def _next(self, trials: Sequence["FrozenTrial"], number: int) -> dict[str, Any]:
        """Return what a trial tries, from nothing but those before it, its number and the root seed."""
        from optuna.samplers import TPESampler

        root = self._tuning.campaign.root_seed
        (seed,) = SeedSequence(root, spawn_key=(number,)).generate_state(1)
        ended = [trial for trial in trials if trial.state.is_finished()]
        study = self._study_of(ended, range(len(self._tuning.objectives)), TPESampler(seed=int(seed)))
        params = study.ask(self._space).params
        return {name: as_tried(values, params[name]) for name, values in self._tuning.space.items()}

    def _study_of(self, ended: Sequence["FrozenTrial"], objectives: Sequence[int], sampler: Any = None) -> "Study":
        """Return a study in memory that has these trials, and of their objectives those at some places."""
        import optuna

        study = optuna.create_study(directions=["minimize"] * len(objectives), sampler=sampler)
        for trial in ended:
            values = [trial.values[place] for place in objectives]
            study.add_trial(optuna.create_trial(values=values, params=trial.params, distributions=self._space))
        return study


def require_optuna() -> Any:
    """Return Optuna, and have tomlkit at hand.

    Raises:
        TuningError: One of them is not installed.
    """
    try:
        import optuna
        import tomlkit  # noqa: F401
    except ImportError as error:
        raise TuningError(f"{error.name} is not installed: pip install {_PACKAGE}[tune]") from error
    return optuna


@contextmanager
def _unwarned() -> Iterator[None]:
    """Use what Optuna calls experimental."""
    from optuna.exceptions import ExperimentalWarning

    with catch_warnings():
        simplefilter("ignore", ExperimentalWarning)
        yield


def _ended(trial: "FrozenTrial") -> Ended:
    kept = trial.user_attrs
    return Ended(
        number=int(kept[_NUMBER]),
        values=tuple(trial.values),
        params=dict(trial.params),
        flights=int(kept[_FLIGHTS]),
        lost=int(kept[_LOST]),
        pruned=bool(kept[_PRUNED]),
        attributes=kept,
    )
