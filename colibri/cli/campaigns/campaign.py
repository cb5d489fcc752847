"""`colibri campaign`."""

from argparse import SUPPRESS, Namespace
from pathlib import Path

from colibri.cli.shared.options import add_engine, add_gate, add_junit, add_out
from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.lifecycle import loading
from colibri.common.spec import add_options as add_spec
from colibri.flights.spec import FlightSpec


def add_options(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add("file", nargs="?", type=Path, metavar="FILE.toml", help="the campaign; options take precedence over it")
    add("--track", dest="tracks", action="append", metavar="TRACK", help="a track; may be repeated: each is flown")
    add(
        "--set",
        dest="settings",
        action="append",
        default=[],
        metavar="KEY=VALUES",
        help="a factor and its values, A,B,C or FIRST:LAST:COUNT: an option of a flight, or a number of profile., "
        "vehicle. or plant-vehicle. by its dotted key; KEY* multiplies what the file has; may be repeated",
    )
    add(
        "--draw",
        dest="draws",
        action="append",
        default=[],
        metavar="KEY=DISTRIBUTION",
        help="a factor drawn for each flight: uniform:LOW:HIGH, log-uniform:LOW:HIGH, normal:MEAN:DEVIATION or "
        "choice:A,B,C; may be repeated",
    )
    add("--seeds", default=SUPPRESS, metavar="FIRST-LAST", help="every combination is flown by each (default 0)")
    add("--root-seed", type=int, default=SUPPRESS, metavar="N", help="of the draws (default 0)")
    add("--name", default=SUPPRESS, help="in titles (default: the file's)")
    add("--metrics", default=SUPPRESS, metavar="A,B", help="numbers of report.json to keep (default: the usual)")
    add("--logs", default=SUPPRESS, choices=("none", "lost", "all"), help="flights whose logs are kept (default none)")
    add_engine(add)
    add("--resume", action="store_true", help="continue the campaign in --out")
    add("--parquet", action="store_true", help="write flights.parquet, too")
    add("--yes", action="store_true", help="also if it has more than a million flights")
    add_spec(parser, FlightSpec, leave_out=("track", "seed", "speed", "params"), given_only=True, keywords_only=True)
    add_gate(add, None)
    add_junit(add)
    add_out(add, "out/campaign", "table, summary, figure and journal")


def run(args: Namespace) -> int:
    with loading():
        from colibri.cli.campaigns.fly_campaign import fly

    return fly(args)
