"""Fly a trial, unless it is clearly worse than the best."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from itertools import islice
from typing import Any, NamedTuple, Self

import numpy as np

from colibri.campaigns.definition import Point
from colibri.campaigns.engines.pool import Engine
from colibri.campaigns.flights import Common, FlightResult, Verdict, fly_points
from colibri.common.types import Array
from colibri.tuning.definition import Tuning
from colibri.tuning.space import TuningError
from colibri.tuning.trials import Begun, FinishedTrial

_WORST, _EACH = "worst", "each"


class Scale(NamedTuple):
    """The original profile's values by objective: of a lost flight, and of each."""

    worst: tuple[float, ...]
    each: tuple[tuple[float, ...], ...]


class TrialFlights:
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

    def __enter__(self) -> Self:
        return self

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


def scale_kept(first: FinishedTrial) -> Scale:
    return Scale(tuple(first.attributes[_WORST]), tuple(map(tuple, first.attributes[_EACH])))


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
