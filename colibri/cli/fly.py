"""`colibri fly`."""

from argparse import Namespace

from colibri.analysis.limits import NONE_LOST
from colibri.cli.shared.beside import add_view, viewed
from colibri.cli.shared.options import add_gate
from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.lifecycle import fail, loading
from colibri.common.spec import add_options as add_spec
from colibri.flights.spec import FlightSpec


def add_options(parser: ArgumentParser) -> None:
    start = "the profile's, and the track's first yaw"
    add_spec(parser, FlightSpec, defaults={"link": "udp"}, shown={"start": start})
    add_view(parser)
    parser.flag("--quiet", "print errors only")
    add_gate(parser, NONE_LOST)
    parser.flag("--no-figures", "draw no PNG figures")


def run(args: Namespace) -> int:
    with loading():
        from colibri.cli.shared.fly_and_report import fly

    if args.view and args.link != "udp":
        fail(f"--view needs --link udp: over {args.link} no autopilot process runs")
    with viewed(args, args.gcs):
        return fly(args)
