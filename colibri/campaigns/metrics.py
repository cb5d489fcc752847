"""Metrics: numbers of a flight's report, or functions of a flight."""

from collections.abc import Callable, Mapping
from math import isfinite
from typing import Any, NamedTuple

from colibri.analysis.limits import KEYS, of_report
from colibri.campaigns.factors import CampaignError
from colibri.common.errors import checked, unknown
from colibri.experiments.flight import Flight

NAMES = (*KEYS, "lost_at_s", "path_lag_s")
_ALWAYS = ("rmse_after_20s_m", "max_error_after_20s_m", "rmse_m", "max_error_m", "max_tilt_deg", "effort_n_m")
_ON_SENSORS = ("control_rmse_m", "estimation_rmse_m.horizontal", "estimation_rmse_m.vertical", "nees_mean")
_OUTCOMES = ("qp_failures", "fallbacks", "lost_at_s")


class Metric(NamedTuple):
    """A column of the table; without `of`, the number of that name in the report."""

    name: str
    of: Callable[[Flight], float | None] | None = None

    def value(self, flight: Flight) -> float | None:
        found = of_report(flight.report, self.name) if self.of is None else self.of(flight)
        return None if found is None or not isfinite(found) else float(found)


def usual(*, sensors: bool) -> tuple[Metric, ...]:
    return tuple(map(Metric, (*_ALWAYS, *(_ON_SENSORS if sensors else ()), *_OUTCOMES)))


def read_metrics(given: Any) -> tuple[Metric, ...]:
    if isinstance(given, Mapping) and given:
        for name, of in given.items():
            checked(f"metric {name}", of, Callable, "a function of a Flight", CampaignError)  # type: ignore[arg-type]
        return tuple(Metric(str(name), of) for name, of in given.items())
    if isinstance(given, str) or callable(given):
        given = given.split(",") if isinstance(given, str) else [given]
    checked("metrics", given, (list, tuple), "names or functions", CampaignError)
    if not given:
        raise CampaignError(f"metrics: name at least one: {', '.join(NAMES)}")
    return tuple(map(_metric, given))


def _metric(given: Any) -> Metric:
    if isinstance(given, Metric):
        return given
    if callable(given):
        return Metric(str(getattr(given, "__name__", type(given).__name__)), given)
    if given not in NAMES:
        raise CampaignError(unknown("metric", given, NAMES))
    return Metric(given)
