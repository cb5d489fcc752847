"""`colibri campaign`: fly a campaign and print the results."""

from argparse import Namespace
from collections.abc import Callable, Sequence
from contextlib import closing
from typing import Any

from colibri.analysis.tables import print_table
from colibri.campaigns.definition import OF_ALL, CampaignTables, campaign_of, tables_of
from colibri.campaigns.factors import CampaignError, first_twice
from colibri.campaigns.gate import handed_over, with_limits
from colibri.campaigns.results import CampaignResults
from colibri.campaigns.run import FlightBar, engine_of, fly_campaign
from colibri.common.process.lifecycle import one_line
from colibri.common.spec import keywords_of
from colibri.flights.spec import FlightSpec

_SHOWN = 5
_TABLES = ("name", "seeds", "root_seed", "metrics", "logs")


def campaign(args: Namespace) -> int:
    with one_line(kept=f"; finished flights are in {args.out}: continue with --resume"):
        said = vars(args)
        tables = {name: said[name] for name in _TABLES if name in said}
        options = {name: said[name] for name in (*OF_ALL, *keywords_of(FlightSpec)) if name in said}
        grid = ({"track": args.tracks} if args.tracks else {}) | _once(_setting, args.settings)
        given = tables | {"fly": options, "grid": grid, "draw": _once(_draw, args.draws)}
        planned = campaign_of(tables_of(CampaignTables, args.file, given))
        planned = planned._replace(metrics=with_limits(planned.metrics, args.fail_above))
        engine = engine_of(args.workers, args.dask)
        with closing(FlightBar(planned.name, planned.flights, quiet=args.quiet)) as bar:
            asked = {name: getattr(args, name) for name in ("resume", "yes", "parquet")}
            results = fly_campaign(planned, engine, args.out, **asked, progress=bar.ended, begun=bar.begun)
    if not (args.quiet or args.json):
        _print(results, args)
    return handed_over(results, args)


def _once(read: Callable[[str], tuple[str, Any]], texts: Sequence[str]) -> dict[str, Any]:
    pairs = list(map(read, texts))
    if twice := first_twice(key for key, _ in pairs):
        raise CampaignError(f"{twice} is given twice: give all values at once")
    return dict(pairs)


def _setting(text: str) -> tuple[str, Any]:
    key, values = _pair(text, "KEY=VALUES, for example body.mass_kg=0.6:0.8:5")
    if values.count(":") == 1 and all(isinstance(_value(part), int | float) for part in values.split(":")):
        raise CampaignError(f"{key}: a range is FIRST:LAST:COUNT, for example {values}:5, not {values}")
    return key, values if values.count(":") == 2 else [_value(each) for each in values.split(",")]


def _draw(text: str) -> tuple[str, Any]:
    key, drawn = _pair(text, "KEY=DISTRIBUTION, for example plant-vehicle.body.mass_kg=uniform:0.6:0.8")
    name, _, rest = drawn.partition(":")
    return key, {name: [_value(each) for each in rest.split("," if name == "choice" else ":")]}


def _pair(text: str, expected: str) -> tuple[str, str]:
    key, equals, value = text.partition("=")
    if not key or not equals or not value:
        raise CampaignError(f"expected {expected}, not {text}")
    return key, value


def _value(text: str) -> Any:
    if text in ("true", "false"):
        return text == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return text


def _print(results: CampaignResults, args: Namespace) -> None:
    counts = ", ".join(f"{count} {verdict}" for verdict, count in results.verdicts.items() if count)
    headings, rows = results.summary()
    metric = results.usual_metric
    shown = [*results.campaign.grid, "flights", "lost", *(f"{metric}_{which}" for which in ("median", "p05", "p95"))]
    cells = [tuple(_short(row[headings.index(name)]) for name in shown) for row in rows]
    title = f"{results.campaign.name}: {counts}; written to {args.out}"
    print_table(title, tuple(shown), cells, names=len(results.campaign.grid))
    print(*results.notes, sep="\n", end="\n" if results.notes else "")
    said: dict[str, int] = {}
    for each in results.flown:
        if each.why:
            said[each.why] = said.get(each.why, 0) + 1
    for why, times in list(said.items())[:_SHOWN]:
        print(f"{times} ×: {why}")
    if len(said) > _SHOWN:
        print(f"and {len(said) - _SHOWN} other reasons: see flights.csv")


def _short(cell: str) -> str:
    try:
        return f"{float(cell):.4g}"
    except ValueError:
        return cell
