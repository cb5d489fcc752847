"""`colibri sitl`: its options, and its call."""

from argparse import Namespace
from math import inf
from pathlib import Path

from colibri.cli.shared.beside import add_view, viewed
from colibri.cli.shared.options import add_signing
from colibri.common.earth.home import DEFAULT_HOME, home
from colibri.common.process.arguments import ArgumentParser, natural, not_negative, positive, speed
from colibri.common.process.lifecycle import fail
from colibri.experiments.options import add_feedback
from colibri.plant.process.options import add_world_arguments


def add_options(parser: ArgumentParser) -> None:
    """Add the options of `colibri sitl`."""
    add = parser.add_argument
    add(
        "--instance", type=natural, default=0, metavar="N", help="number of the (first) vehicle: its system id is N + 1"
    )
    add("--count", type=natural, default=1, metavar="N", help="how many vehicles (default 1)")
    add(
        "--home",
        type=home,
        default=DEFAULT_HOME,
        metavar="LAT,LON,ALT,YAW",
        help="where they stand, degrees and m, yaw clockwise from north (default Zurich: %(default)s)",
    )
    add(
        "--spacing",
        type=not_negative,
        default=3.0,
        metavar="M",
        help="how far each vehicle of a fleet stands east of the one before (default %(default)g)",
    )
    add("--identity", default="px4", choices=("px4", "generic"), help="what they say they are (default %(default)s)")
    add(
        "--gcs",
        action="append",
        default=[],
        metavar="URL",
        help="a ground station to call or to wait for: udpout:, udpin:, tcp: or tcpin:HOST:PORT, or "
        "serial:DEVICE:BAUD; may be repeated "
        "(default: udpout:127.0.0.1:14550, and udpout:127.0.0.1:14540 + N)",
    )
    add_view(add)
    add_signing(add)
    add(
        "--state",
        type=Path,
        default=Path("out/sitl"),
        metavar="DIR",
        help="for parameters and logs (default %(default)s)",
    )
    add(
        "--out",
        type=Path,
        metavar="DIR",
        help="record in DIR/N what `colibri replay` flies again: both processes' logs (default: not)",
    )
    add("--plant-port", type=int, metavar="PORT", help="the plant's (default: 14560 + N; 0: any that is free)")
    add("--profile", default="flight", metavar="NAME", help="control profile name or .toml (default %(default)s)")
    add("--controller", metavar="NAME", help="control law, also of another package (default: the profile's)")
    add("--vehicle", metavar="NAME", help="vehicle name or .toml (default: the profile's)")
    add("--plant-vehicle", metavar="NAME", help="another vehicle for the plant alone, to fly what was not planned for")
    add_world_arguments(parser, start="standing at home")
    add_feedback(parser)
    add("--seed", type=natural, default=0, metavar="N", help="of everything random; each vehicle adds its number")
    add("--speed", type=speed, default=1.0, metavar="N", help="times real time, or max (default 1)")
    add("--duration", type=positive, default=inf, metavar="S", help="end after this simulated time (default: never)")
    add("--strict", action="store_true", help="end by what a part raises in flight; default: it is replaced, flown on")
    add("--quiet", action="store_true", help="say nothing but errors")


def run(args: Namespace) -> int:
    """Serve ground stations as the command line says; return the exit code."""
    from colibri.flights.fleet import ground_links, sitl

    if args.view and args.count > 1:
        fail("--view shows one vehicle: leave --count out")
    with viewed(args, ground_links(args, args.instance)):
        return sitl(args)
