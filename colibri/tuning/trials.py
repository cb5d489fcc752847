"""The trials of a tuning: an Optuna study in a shared journal."""

import fcntl
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from time import sleep
from typing import TYPE_CHECKING, Any, NamedTuple, Self, cast
from warnings import catch_warnings, simplefilter

from numpy.random import SeedSequence

from colibri.common.files import regular
from colibri.tuning.definition import Tuning, TuningError, as_tried, distribution

if TYPE_CHECKING:
    from optuna import Study, Trial
    from optuna.trial import FrozenTrial


class FileLock:
    """An exclusive lock on a folder or a file, which is created if missing."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: int | None = None

    def acquire(self, *, wait: bool = True) -> bool:
        how = os.O_RDONLY if self._path.is_dir() else os.O_RDWR | os.O_CREAT
        opened = os.open(self._path, how | os.O_NONBLOCK | os.O_CLOEXEC, 0o666)
        try:
            fcntl.flock(opened, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            os.close(opened)
            return False
        self._file = opened
        return True

    def release(self) -> None:
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def __enter__(self) -> Self:
        self.acquire()
        return self

    def __exit__(self, *_error: object) -> None:
        self.release()


class JournalLock(FileLock):
    """A writer's lock on a journal; drops a dead one's incomplete line."""

    def __init__(self, journal: Path) -> None:
        super().__init__(journal.with_name(f"{journal.name}.lock"))
        self._journal = journal

    def acquire(self, *, wait: bool = True) -> bool:
        if not super().acquire(wait=wait):
            return False
        with open(self._journal, "r+b", opener=regular) as file:
            if file.seek(0, os.SEEK_END):
                file.seek(-1, os.SEEK_END)
                if file.read() != b"\n":
                    file.seek(0)
                    file.truncate(file.read().rfind(b"\n") + 1)
        return True


_PACKAGE = "colibri-sitl"
JOURNAL, _LOCKS = "trials.log", "locks"
_NUMBER, _PROCESS, _FLIGHTS, _LOST, _PRUNED = "number", "process", "flights", "lost", "pruned"
_POLL_S = 0.2
_MAX_P = 0.05  # a worse trial is pruned at this significance level
_BEST_PART, _MIN_TRIALS = 0.25, 8


class FinishedTrial(NamedTuple):
    """A trial; number 0 is the original profile. If pruned, values are extrapolated."""

    number: int
    values: tuple[float, ...]
    params: dict[str, Any]
    flights: int
    lost: int
    pruned: bool
    attributes: Mapping[str, Any]


class Begun(NamedTuple):
    number: int
    params: dict[str, Any]
    trial: "Trial"


class Trials(AbstractContextManager["Trials"]):
    """The trials of a tuning in a folder, shared by processes.

    Each holds a lock that ends with it, so that others repeat its unfinished trials. A trial depends on earlier trials,
    its number and the root seed: a resumed tuning continues as it would have.
    """

    def __init__(self, folder: Path, tuning: Tuning) -> None:
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

    def __exit__(self, *_error: object) -> None:
        self._held.release()

    def ask(self) -> Begun | None:
        """Begin the next trial, if any, after waiting for the first and for other processes, which may die."""
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

    def tell(self, begun: Begun, ended: FinishedTrial) -> None:
        kept = {_FLIGHTS: ended.flights, _LOST: ended.lost, _PRUNED: ended.pruned, **ended.attributes}
        for name, value in kept.items():
            begun.trial.set_user_attr(name, value)
        self._study.tell(begun.trial, list(ended.values))

    @property
    def ended(self) -> list[FinishedTrial]:
        return [_ended(trial) for trial in self._trials() if trial.state.is_finished()]

    def importances(self) -> list[dict[str, float]]:
        """Return each number's importance for being among the best quarter of trials, by objective.

        S. Watanabe, A. Bansal, F. Hutter, PED-ANOVA: Efficiently Quantifying Hyperparameter Importance in Arbitrary
        Subspaces, IJCAI 2023. Their default, a tenth, would be too few trials.
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
        place = 0
        while not (lock := FileLock(self._folder / f"process-{place}")).acquire(wait=False):
            place += 1
        return place, lock

    def _trials(self) -> list["FrozenTrial"]:
        from optuna.trial import TrialState

        states = (TrialState.COMPLETE, TrialState.RUNNING)
        trials = self._study.get_trials(deepcopy=False, states=states)
        return sorted(trials, key=lambda trial: int(trial.user_attrs[_NUMBER]))

    def _give_up_abandoned(self) -> None:
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
        from optuna.samplers import TPESampler

        root = self._tuning.campaign.root_seed
        (seed,) = SeedSequence(root, spawn_key=(number,)).generate_state(1)
        ended = [trial for trial in trials if trial.state.is_finished()]
        study = self._study_of(ended, range(len(self._tuning.objectives)), TPESampler(seed=int(seed)))
        params = study.ask(self._space).params
        return {name: as_tried(values, params[name]) for name, values in self._tuning.space.items()}

    def _study_of(self, ended: Sequence["FrozenTrial"], objectives: Sequence[int], sampler: Any = None) -> "Study":
        import optuna

        study = optuna.create_study(directions=["minimize"] * len(objectives), sampler=sampler)
        for trial in ended:
            values = [trial.values[place] for place in objectives]
            study.add_trial(optuna.create_trial(values=values, params=trial.params, distributions=self._space))
        return study


def require_optuna() -> Any:
    """Import Optuna and check for tomlkit."""
    try:
        import optuna
        import tomlkit  # noqa: F401
    except ImportError as error:
        raise TuningError(f"{error.name} is not installed: pip install {_PACKAGE}[tune]") from error
    return optuna


@contextmanager
def _unwarned() -> Iterator[None]:
    from optuna.exceptions import ExperimentalWarning

    with catch_warnings():
        simplefilter("ignore", ExperimentalWarning)
        yield


def _ended(trial: "FrozenTrial") -> FinishedTrial:
    kept = trial.user_attrs
    counts = (kept[_FLIGHTS], kept[_LOST], kept[_PRUNED])
    return FinishedTrial(kept[_NUMBER], tuple(trial.values), dict(trial.params), *counts, kept)
