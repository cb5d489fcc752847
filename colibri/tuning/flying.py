"""A trial flown: step by step, some seeds each, until its end or until it is clearly worse than the best."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from itertools import islice
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from colibri.campaigns.definition import Point
from colibri.campaigns.engines.engine import Engine
from colibri.campaigns.flights import Common, Flown, Verdict, fly_points
from colibri.common.types import Array
from colibri.tuning.space import TuningError
from colibri.tuning.trials import Begun, Ended

if TYPE_CHECKING:
    from colibri.tuning.definition import Tuning

_WORST, _EACH = "worst", "each"


class Scale(NamedTuple):
    """What the flights with the profile as it is say about all others.

    Attributes:
        worst: What a lost flight counts, for each objective.
        each: What each flight counts, step by step, for each objective.
    """

    worst: tuple[float, ...]
    each: tuple[tuple[float, ...], ...]


class Flights:
    """Flights by an engine whose workers stay from one trial to the next."""

    def __init__(self, engine: Engine, common: Common) -> None:
        """Fly by `engine`; the factors of each flight hold beside what is in `common`."""
        self._left: deque[Point] = deque()
        self._flown = fly_points(self, common, engine)

    def fly(self, points: Sequence[Point]) -> list[Flown]:
        """Return what comes of flights, in their order."""
        self._left.extend(points)
        found = {flown.flight: flown for flown in islice(self._flown, len(points))}
        return [found[point.flight] for point in points]

    def __iter__(self) -> Self:
        """Be what an engine takes its jobs from, again and again: more come when what it was given has ended."""
        return self

    def __next__(self) -> Point:
        """Return the next flight; none is left until more are to be flown."""
        if not self._left:
            raise StopIteration
        return self._left.popleft()

    def __enter__(self) -> Self:
        """Begin."""
        return self

    def __exit__(self, *_error: object) -> None:
        """End the workers."""
        self._flown.close()


def fly_trial(
    tuning: "Tuning",
    begun: Begun,
    flights: Flights,
    scale: Scale | None,
    best: float,
    progress: Callable[[Flown], object],
) -> Ended:
    """Fly a trial.

    Args:
        tuning: What it is a trial of.
        begun: The trial.
        flights: Fly it.
        scale: By the profile as it is; None where the trial is that.
        best: The least value of a trial until now; one that is pruned is no better.
        progress: Is given each flight.

    Raises:
        TuningError: The profile as it is cannot be measured.
    """
    factors = tuning.flown(begun.params)
    flown: list[Flown] = []
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


def scale_of(tuning: "Tuning", flown: Sequence[Flown]) -> Scale:
    """Return the scale by flights with the profile as it is.

    Raises:
        TuningError: They cannot be measured.
    """
    refused = next((each for each in flown if each.verdict is Verdict.REFUSED), None)
    if refused is not None:
        raise TuningError(refused.why)
    worst = tuple(objective.worst(flown, tuning.campaign.metrics) for objective in tuning.objectives)
    return Scale(worst, tuple(tuple(each.tolist()) for each in _counts(tuning, flown, worst)))


def scale_kept(first: Ended) -> Scale:
    """Return the scale that was kept with the first trial."""
    return Scale(tuple(first.attributes[_WORST]), tuple(map(tuple, first.attributes[_EACH])))


def _counts(tuning: "Tuning", flown: Sequence[Flown], worst: Sequence[float]) -> list[Array]:
    """Return what each flight counts for each objective."""
    metrics = tuning.campaign.metrics
    return [
        objective.of_flights(flown, metrics, at_most)
        for objective, at_most in zip(tuning.objectives, worst, strict=True)
    ]


def _is_pruned(tuning: "Tuning", begun: Begun, counts: Array, new: int) -> bool:
    """Tell Optuna of the last flights; return whether the trial is clearly worse than the best, and not at its end."""
    if not tuning.prune_after:
        return False
    for place in range(len(counts) - new, len(counts)):
        begun.trial.report(float(counts[place]), place)
    return len(counts) < tuning.campaign.flights and begun.trial.should_prune()


def _expected(tuning: "Tuning", counts: Array, scale: Scale) -> float:
    """Return what a trial would have come to by all seeds, if it kept its ratio to the profile as it is."""
    (objective,) = tuning.objectives
    whole = np.array(scale.each[0])
    pooled, same = objective.pooled(counts), objective.pooled(whole[: len(counts)])
    return float(pooled * (objective.pooled(whole) / same if same else 1.0))


def _ended(
    begun: Begun,
    flown: Sequence[Flown],
    values: tuple[float, ...],
    *,
    pruned: bool = False,
    scale: Scale | None = None,
) -> Ended:
    lost = sum(each.verdict is not Verdict.FLOWN for each in flown)
    kept: Mapping[str, Any] = {} if scale is None else {_WORST: list(scale.worst), _EACH: list(map(list, scale.each))}
    return Ended(begun.number, values, begun.params, len(flown), lost, pruned, kept)
