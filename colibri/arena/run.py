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
from colibri.common.process.lifecycle import one_line
from colibri.conformance.subject import profile_for
from colibri.studies.comparison import contenders_of

DEFAULT_LAWS = ("agile", "flight", "se3")


def arena(args: Namespace) -> int:
    """Fly each set in a folder of its name, and print its tables."""
    with one_line(kept=f"; finished flights are in {args.out}: continue with --resume"):
        laws, sets, code = laws_of(args.law or DEFAULT_LAWS), list(dict.fromkeys(args.sets)), 0
        if len(sets) > 1 and (args.json or args.junit):
            raise CampaignError(f'{"--json" if args.json else "--junit"}: takes one set, not "{" ".join(sets)}"')
        for name, planned in [(name, planned_of(name, laws, args.starts)) for name in sets]:
            planned = planned._replace(metrics=with_limits(planned.metrics, args.fail_above))
            out, engine = args.out / Path(name).stem, engine_of(args.workers, args.dask)
            with closing(FlightBar(name, planned.flights, quiet=args.quiet)) as bar:
                watch: dict[str, Any] = {"progress": bar.ended, "begun": bar.begun}
                results = fly_campaign(planned, engine, out, resume=args.resume, kind=ArenaResults, **watch)
            assert isinstance(results, ArenaResults)
            if not (args.quiet or args.json):
                print_table(f"{name}: worst mean error, mm; written to {out}", *results.table(), names=3)
                print_table(f"{name}: laws", *results.law_table(), names=1)
            code = max(code, handed_over(results, args))
        return code


def planned_of(name: str, laws: dict[str, dict[str, Any]], starts: int) -> Campaign:
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
            law = full_name(text) if is_place(text) else text
            name = table_of(law)
            found[law if name in found else name] = {"profile": profile_for(law), "controller": text}
    return found
