"""A campaign as data, with its metrics: numbers of a flight's report, or functions of a flight."""

from argparse import ArgumentTypeError
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import islice, product
from math import isfinite, prod
from pathlib import Path, PurePath
from types import NoneType
from typing import Any, ClassVar, Literal, NamedTuple, TypeAlias, TypeVar

import msgspec
from numpy.random import PCG64, Generator, SeedSequence

from colibri.analysis.limits import KEYS, of_report
from colibri.campaigns.factors import (
    CampaignError,
    Choice,
    Draw,
    Level,
    factor_name,
    first_twice,
    has_levels,
    is_number,
    read_draw,
    read_values,
)
from colibri.common.config import plain, read_settings, read_toml
from colibri.common.errors import checked, unknown
from colibri.common.process.arguments import seeds
from colibri.common.spec import keywords_of
from colibri.experiments.flight import Flight
from colibri.flights.spec import FlightSpec
from colibri.mavlink.hil.feedback import Feedback

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


Logs: TypeAlias = Literal["none", "lost", "all"]
OF_ALL = ("link",)  # options that must be equal for all flights of a campaign
_MAX_SEED = 2**63 - 1
MAX_UNASKED = 1_000_000  # flights of a campaign without `yes`


class FlightTables(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Tables shared by the files of campaigns and tunings."""

    FACTORS: ClassVar[tuple[str, ...]] = ("fly", "grid", "draw")
    name: str = "campaign"
    seeds: Any = "0"  # one, several, or `1-20`; every combination of the grid is flown with each
    root_seed: int = 0  # seed of the draws
    metrics: Any = None
    fly: dict[str, Any] = {}
    grid: dict[str, Any] = {}  # factors with several values, or with levels: named tables of settings
    draw: dict[str, Any] = {}  # factors drawn at random for each flight


Tables = TypeVar("Tables", bound=FlightTables)


class CampaignTables(FlightTables, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The tables of a campaign's file; `paired` uses a seed's draws in every combination of the grid."""

    paired: bool = False
    logs: Logs = "none"


class Point(NamedTuple):
    """One flight of a campaign; `folder` is relative to the campaign's."""

    flight: int
    seed: int
    factors: dict[str, Any]
    folder: str

    @property
    def settings(self) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for name, value in self.factors.items():
            found |= value.settings if isinstance(value, Level) else {name: value}
        return found


class Campaign(NamedTuple):
    """A validated campaign; see `CampaignTables`."""

    name: str
    seeds: Sequence[int]
    root_seed: int
    paired: bool
    metrics: tuple[Metric, ...]
    logs: Logs
    fly: dict[str, Any]
    grid: dict[str, tuple[Any, ...]]
    draw: dict[str, Draw]

    @property
    def flights(self) -> int:
        return len(self.seeds) * self.combinations

    @property
    def combinations(self) -> int:
        return prod(map(len, self.grid.values()))

    @property
    def factors(self) -> tuple[str, ...]:
        return (*self.grid, *self.draw)

    @property
    def columns(self) -> tuple[str, ...]:
        metrics = (metric.name for metric in self.metrics)
        return ("flight", *self.factors, "seed", *metrics, "verdict", "why", "trajectory_sha256")

    def points(self) -> Iterator[Point]:
        flight = 0
        for values in product(*self.grid.values()):
            combination = dict(zip(self.grid, values, strict=True))
            for place, seed in enumerate(self.seeds):
                factors = combination | self._drawn(place if self.paired else flight)
                yield Point(flight, seed, factors, f"flights/{flight:06d}")
                flight += 1

    def samples(self) -> Iterator[Point]:
        """Yield flights that test all values of each factor, of numbers the ends."""
        first = next(self.points())._replace(seed=self.seeds[-1])
        yield first
        for factor, values in self.grid.items():
            ends = (values[0], values[-1]) if all(map(is_number, values)) else values
            for value in islice(ends, 1, None):
                yield first._replace(factors=first.factors | {factor: value})
        for factor, draw in self.draw.items():
            for value in draw.typical:
                yield first._replace(factors=first.factors | {factor: value})

    def values(self, option: str) -> Iterator[Any]:
        """Yield the values of an option, without continuous draws."""
        draw = self.draw.get(option)
        levels = (each.settings for values in self.grid.values() for each in values if isinstance(each, Level))
        yield from (each[option] for each in (self.fly, *levels) if option in each)
        yield from (each for each in self.grid.get(option, ()) if not isinstance(each, Level))
        yield from draw.values if isinstance(draw, Choice) else ()

    def _drawn(self, stream: int) -> dict[str, Any]:
        if not self.draw:
            return {}
        chance = Generator(PCG64(SeedSequence(self.root_seed, spawn_key=(stream,))))
        return {factor: draw.value(chance) for factor, draw in self.draw.items()}


def tables_of(kind: type[Tables], file: str | Path | None, given: Mapping[str, Any]) -> Tables:
    """Read a file and override it by keywords, factor by factor."""
    checked("file", file, (str, PurePath, NoneType), "the name of a TOML file", CampaignError)
    base = kind() if file is None else read_toml(Path(file), kind, CampaignError)
    known = kind.__struct_fields__
    for name in given:
        if name not in known:
            raise CampaignError(unknown("option", name, known))
    given = {name: plain(value) for name, value in given.items()}
    read_settings(given, kind)
    named = {name_in_tables(*each) for table in kind.FACTORS for each in given.get(table, {}).items()}
    for table in kind.FACTORS:
        kept = {key: value for key, value in getattr(base, table).items() if name_in_tables(key, value) not in named}
        given[table] = kept | given.get(table, {})
    called = {} if file is None or base.name != kind().name else {"name": Path(file).stem}
    return msgspec.structs.replace(base, **(called | given))


def campaign_of(tables: CampaignTables) -> Campaign:
    if tables.root_seed < 0:
        raise CampaignError(f"root_seed: must not be below zero, not {tables.root_seed}")
    planned = Campaign(
        name=tables.name,
        seeds=read_seeds(tables.seeds),
        root_seed=tables.root_seed,
        paired=tables.paired,
        metrics=() if tables.metrics is None else read_metrics(tables.metrics),
        logs=tables.logs,
        fly=_named(tables.fly, *OF_ALL),
        grid={
            name: tuple(Level(str(level), _named(settings)) for level, settings in values.items())
            if has_levels(values)
            else read_values(name, values)
            for name, values in _named(tables.grid).items()
        },
        draw={name: read_draw(name, given) for name, given in _named(tables.draw).items()},
    )
    if tables.metrics is None:
        sensors = Feedback.SENSORS in map(str, planned.values("feedback"))
        planned = planned._replace(metrics=usual(sensors=sensors))
    _check_names(planned)
    return planned


def read_seeds(given: Any) -> Sequence[int]:
    given = plain(given)
    try:
        found: Sequence[int] = given if isinstance(given, list | tuple | range) else seeds(str(given))
    except ArgumentTypeError:
        found = ()
    ends = (found[0], found[-1]) if isinstance(found, range) and found else found  # a range is not expanded
    right = all(type(seed) is int and 0 <= seed < _MAX_SEED for seed in ends)
    if not ends or not right or (not isinstance(found, range) and len(set(found)) < len(found)):
        raise CampaignError(f'seeds: must be FIRST-LAST, a number, or a list of different numbers, not "{given}"')
    return found if isinstance(found, range) else tuple(found)


def name_in_tables(given: str, value: Any, others: Sequence[str] = OF_ALL) -> str:
    """Return the canonical name of a factor; `others` and names with levels are kept."""
    return given if given in others or has_levels(value) else factor_name(given)


def _named(given: Mapping[str, Any], *others: str) -> dict[str, Any]:
    names = [name_in_tables(name, value, others) for name, value in given.items()]
    if twice := first_twice(names):
        raise CampaignError(f"{twice} is given twice, under two names")
    return dict(zip(names, given.values(), strict=True))


def _check_names(planned: Campaign) -> None:
    said = [*planned.fly, *planned.draw]
    for name, values in planned.grid.items():
        levels = [each.settings for each in values if isinstance(each, Level)]
        if any(name not in settings for settings in levels) and name in keywords_of(FlightSpec):
            raise CampaignError(f"{name}: a factor with levels needs a name that is not an option")
        said += dict.fromkeys(key for settings in levels for key in settings) if levels else [name]
    if twice := first_twice(said):
        raise CampaignError(f"{twice} is given twice: keep it in one of fly, grid and draw")
    if twice := first_twice(planned.columns):
        raise CampaignError(f"{twice}: the table would have two columns of that name: choose another")
    if "track" not in said:
        raise CampaignError('no track: add one, for example track = ["spiral"] in grid')
