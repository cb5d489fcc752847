"""`colibri arena`: fly a set by several laws."""

from argparse import Namespace
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from colibri.analysis.tables import print_table
from colibri.arena.flights import MAX_STARTS, Arena
from colibri.arena.results import METRICS, ArenaResults
from colibri.autopilot.control.law_files import full_name, is_place, table_of
from colibri.autopilot.control.profile import profile_names
from colibri.autopilot.control.registry import controller_names
from colibri.campaigns.bar import FlightBar
from colibri.campaigns.definition import Campaign, CampaignTables, campaign_of
from colibri.campaigns.factors import CampaignError, first_twice
from colibri.campaigns.gate import handed_over, with_limits
from colibri.campaigns.run import engine_of, fly_campaign
from colibri.common.errors import unknown
from colibri.conformance.subject import profile_for
from colibri.studies.comparison import contenders_of

DEFAULT_LAWS = ("agile", "flight", "se3")


def arena(args: Namespace) -> int:
    """Fly each set in a folder of its name, print its tables, and return the exit code."""
    laws, code = laws_of(args.law or DEFAULT_LAWS), 0
    for name in dict.fromkeys(args.sets):
        planned = planned_of(name, laws, args.starts)
        planned = planned._replace(metrics=with_limits(planned.metrics, args.fail_above))
        out = args.out / Path(name).stem
        with closing(FlightBar(planned.name, planned.flights, quiet=args.quiet)) as bar:
            results = fly_campaign(
                planned,
                engine_of(args.workers, args.dask),
                out,
                resume=args.resume,
                progress=bar.ended,
                begun=bar.begun,
                kind=ArenaResults,
            )
        assert isinstance(results, ArenaResults)
        if not (args.quiet or args.json):
            print_table(f"{name}: worst mean error, mm; written to {out}", *results.table(), names=3)
            print_table(f"{name}: laws", *results.law_table(), names=1)
        code = max(code, handed_over(results, args))
    return code


def planned_of(name: str, laws: dict[str, dict[str, Any]], starts: int) -> Campaign:
    """Return the campaign of a set; its cases are the rows, from each start."""
    if not 1 <= starts <= MAX_STARTS:
        raise CampaignError(f'starts: must be 1 to {MAX_STARTS}, not "{starts}"')
    flown = Arena(name)
    cases = {f"{row}, start {start}": flown.settings(row, start) for row in flown.set.rows() for start in range(starts)}
    return campaign_of(CampaignTables(name=name, grid={"law": laws, "case": cases}, metrics=METRICS))


def laws_of(given: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return the levels of factor `law`, of `PROFILE[:CONTROLLER]`, a controller, or `FILE.py[:CLASS]`."""
    found: dict[str, dict[str, Any]] = {}
    if twice := first_twice(given):
        raise CampaignError(f'law: "{twice}" is given twice')
    for text in given:
        if ".toml" in text or text.partition(":")[0] in profile_names():
            found |= contenders_of([text])
        elif not is_place(text) and text not in controller_names():
            raise CampaignError(unknown("law", text, [*profile_names(), *controller_names(), "FILE.py[:CLASS]"]))
        else:
            name = full_name(text) if is_place(text) else text
            found[table_of(name)] = {"profile": profile_for(name), "controller": text}
    return found
