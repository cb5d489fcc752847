"""`colibri campaign`."""

from argparse import SUPPRESS, Namespace
from pathlib import Path

from colibri.cli.shared.options import add_engine, add_gate, add_junit, add_out
from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.lifecycle import loading
from colibri.common.spec import add_options as add_spec
from colibri.flights.spec import FlightSpec


def add_options(parser: ArgumentParser) -> None:
    add = parser.value
    add("file", "FILE.toml", "the campaign; options take precedence over it", nargs="?", type=Path)
    add("--track", "TRACK", "a track; may be repeated: each is flown", dest="tracks", action="append")
    parser.several(
        "--set",
        "KEY=VALUES",
        "a factor and its values, A,B,C or FIRST:LAST:COUNT: an option of a flight, or a number of profile., "
        "vehicle. or plant-vehicle. by its dotted key; KEY* multiplies what the file has",
        dest="settings",
    )
    parser.several(
        "--draw",
        "KEY=DISTRIBUTION",
        "a factor drawn for each flight: uniform:LOW:HIGH, log-uniform:LOW:HIGH, normal:MEAN:DEVIATION or choice:A,B,C",
        dest="draws",
    )
    add("--seeds", "FIRST-LAST", "every combination is flown by each (default 0)", default=SUPPRESS)
    add("--root-seed", "N", "of the draws (default 0)", type=int, default=SUPPRESS)
    parser.add_argument("--name", default=SUPPRESS, help="in titles (default: the file's)")
    add("--metrics", "A,B", "numbers of report.json to keep (default: the usual)", default=SUPPRESS)
    parser.add_argument(
        "--logs", default=SUPPRESS, choices=("none", "lost", "all"), help="flights whose logs are kept (default none)"
    )
    add_engine(parser)
    parser.flag("--resume", "continue the campaign in --out")
    parser.flag("--parquet", "write flights.parquet, too")
    parser.flag("--yes", "also if it has more than a million flights")
    add_spec(parser, FlightSpec, leave_out=("track", "seed", "speed", "params"), given_only=True, keywords_only=True)
    add_gate(parser, None)
    add_junit(parser)
    add_out(parser, "out/campaign", "table, summary, figure and journal")


def run(args: Namespace) -> int:
    with loading():
        from colibri.cli.campaigns.fly_campaign import fly

    return fly(args)
