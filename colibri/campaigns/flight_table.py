"""The tables of a campaign."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from math import isnan, nan, sqrt
from typing import Any

import numpy as np

from colibri.analysis.tables import Row
from colibri.campaigns.definition import Campaign
from colibri.campaigns.factors import CampaignError, is_number, shown
from colibri.campaigns.flights import FlightResult, Verdict
from colibri.experiments.flight import SampleTable

_NORMAL_95 = 1.959963984540054
_QUANTILES = {"median": 0.5, "p05": 0.05, "p95": 0.95}


class FlightTable:
    def __init__(self, campaign: Campaign, flown: Mapping[int, FlightResult], notes: Sequence[str] = ()) -> None:
        self.campaign = campaign
        self.notes = [*notes]
        self.flown = [flown[flight] for flight in sorted(flown)]
        self._points = {point.flight: point for point in campaign.points() if point.flight in flown}

    @property
    def headings(self) -> Row:
        return self.campaign.columns

    def rows(self) -> list[Row]:
        """Return a row of texts per flight; numbers have ten digits."""
        return [self._row(each) for each in self.flown]

    @cached_property
    def flights(self) -> SampleTable:
        """The table as a structured array; a missing number is nan."""
        columns: dict[str, Any] = {"flight": [each.flight for each in self.flown]}
        columns |= {name: self.factor(name) for name in self.campaign.factors}
        columns["seed"] = [self._points[each.flight].seed for each in self.flown]
        columns |= {metric.name: self.metric(metric.name) for metric in self.campaign.metrics}
        columns["verdict"] = [str(each.verdict) for each in self.flown]
        columns["why"] = [each.why for each in self.flown]
        columns["trajectory_sha256"] = [each.sha256 for each in self.flown]
        arrays = {name: np.asarray(values) for name, values in columns.items()}
        table = np.empty(len(self.flown), dtype=[(name, array.dtype) for name, array in arrays.items()])
        for name, array in arrays.items():
            table[name] = array
        return table.view(SampleTable)

    def to_pandas(self) -> Any:
        """Return a pandas.DataFrame; PandasError without pandas."""
        return self.flights.to_pandas()

    def factor(self, name: str) -> np.ndarray[Any, Any]:
        """Return the values of a factor, (n,): numbers, or texts."""
        values = [self._points[each.flight].factors[name] for each in self.flown]
        return np.array(values if all(map(is_number, values)) else list(map(shown, values)))

    def metric(self, name: str) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Return a metric of each flight, (n,), nan where missing."""
        names = [metric.name for metric in self.campaign.metrics]
        if name not in names:
            raise CampaignError(f"metric {name} is not in the table: choose {', '.join(names)}")
        place = names.index(name)
        values = (each.metrics[place] for each in self.flown)
        return np.array([nan if value is None else value for value in values], dtype=np.float64)

    @property
    def usual_metric(self) -> str:
        names = [metric.name for metric in self.campaign.metrics]
        known = [int(np.isfinite(self.metric(name)).sum()) for name in names]
        return names[int(np.argmax(known))]

    @property
    def verdicts(self) -> dict[Verdict, int]:
        """The number of flights by verdict."""
        return {verdict: sum(each.verdict is verdict for each in self.flown) for verdict in Verdict}

    def groups(self) -> dict[tuple[Any, ...], list[int]]:
        """Return the places in `flown` of each combination's flights."""
        found: dict[tuple[Any, ...], list[int]] = {}
        for place, each in enumerate(self.flown):
            factors = self._points[each.flight].factors
            found.setdefault(tuple(shown(factors[name]) for name in self.campaign.grid), []).append(place)
        return found

    def without_effect(self) -> list[str]:
        """Return factors of the grid without effect."""
        return [] if self.campaign.draw else [name for name in self.campaign.grid if self._is_idle(name)]

    def _is_idle(self, factor: str) -> bool:
        found: dict[tuple[Any, ...], list[str]] = {}
        for each in self.flown:
            point = self._points[each.flight]
            others = (shown(value) for name, value in point.factors.items() if name != factor)
            found.setdefault((point.seed, *others), []).append(each.sha256)
        values = len(self.campaign.grid[factor])
        same = (len(it) == values and all(it) and len(set(it)) == 1 for it in found.values())
        return values > 1 and all(same)

    def summary(self) -> tuple[Row, list[Row]]:
        """Return headings and one row per combination: share lost, quantiles of metrics."""
        names = [metric.name for metric in self.campaign.metrics]
        headings = (
            *self.campaign.grid,
            *("flights", "refused", "lost", "share_lost", "share_lost_low", "share_lost_high"),
            *(f"{name}_{which}" for name in names for which in (*_QUANTILES, "largest")),
        )
        values = {name: self.metric(name) for name in names}
        rows = []
        for combination, places in self.groups().items():
            lost, of, refused = self.lost(places)
            shares = (lost / of if of else nan, *wilson(lost, of))
            cells = [*map(str, (len(places), refused, lost)), *map(_cell, shares)]
            for name in names:
                cells += _distribution(values[name][self.through(places)])
            rows.append((*combination, *cells))
        return headings, rows

    def through(self, places: Sequence[int]) -> list[int]:
        return [place for place in places if self.flown[place].verdict is Verdict.FLOWN]

    def lost(self, places: Sequence[int]) -> tuple[int, int, int]:
        """Return the number of flights lost, flown and refused."""
        verdicts = [self.flown[place].verdict for place in places]
        refused = verdicts.count(Verdict.REFUSED)
        return sum(verdict.is_lost for verdict in verdicts), len(verdicts) - refused, refused

    def _row(self, each: FlightResult) -> Row:
        point = self._points[each.flight]
        factors = (shown(point.factors[name]) for name in self.campaign.factors)
        metrics = ("" if value is None else _cell(value) for value in each.metrics)
        return (str(each.flight), *factors, str(point.seed), *metrics, str(each.verdict), each.why, each.sha256)


def wilson(lost: int, of: int) -> tuple[float, float]:
    """Return the Wilson score interval at 95 % confidence (E. B. Wilson, JASA 22, 1927)."""
    if not of:
        return 0.0, 1.0
    share, z2 = lost / of, _NORMAL_95**2
    middle = (share + z2 / (2 * of)) / (1.0 + z2 / of)
    half = _NORMAL_95 * sqrt(share * (1.0 - share) / of + z2 / (4.0 * of * of)) / (1.0 + z2 / of)
    return middle - half if lost else 0.0, middle + half if lost < of else 1.0  # exact where none or all are lost


def _distribution(values: np.ndarray[Any, np.dtype[np.float64]]) -> list[str]:
    known = values[~np.isnan(values)]
    if not len(known):
        return [""] * (len(_QUANTILES) + 1)
    quantiles = np.quantile(known, list(_QUANTILES.values())).tolist()
    return [*map(_cell, quantiles), _cell(float(known.max()))]


def _cell(value: float) -> str:
    return "" if isnan(value) else f"{value:.10g}"
