"""`colibri sitl`."""

from argparse import Namespace

from colibri.cli.shared.beside import add_view, viewed
from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.lifecycle import fail
from colibri.common.spec import add_options as add_spec
from colibri.common.spec import from_namespace
from colibri.flights.fleet_spec import FleetSpec


def add_options(parser: ArgumentParser) -> None:
    shown = {
        "gcs": "udpout:127.0.0.1:14550, and udpout:127.0.0.1:14540 + N or, as ardupilot, tcpin:127.0.0.1:5760 + 10 N",
        "start": "standing at home",
    }
    add_spec(parser, FleetSpec, leave_out=("floor",), shown=shown)
    add_view(parser)
    parser.flag("--quiet", "print errors only")


def run(args: Namespace) -> int:
    from colibri.flights.fleet import sitl

    if args.view and args.count > 1:
        fail("--view shows one vehicle: leave --count out")
    with viewed(args, from_namespace(FleetSpec, args).links(args.instance)):
        return sitl(from_namespace(FleetSpec, args), quiet=args.quiet)
