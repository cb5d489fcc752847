"""`colibri check-controller`."""

from argparse import Namespace

from colibri.common.process.arguments import ArgumentParser, natural, positive
from colibri.common.process.lifecycle import loading


def add_options(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add("name", metavar="NAME", help="control law, also of another package")
    add("--profile", metavar="NAME", help="control profile name or .toml (default: the one with numbers for the law)")
    add("--vehicle", metavar="NAME", help="vehicle name or .toml (default: the profile's)")
    add("--seed", type=natural, default=0, metavar="N", help="seed of everything random (default %(default)s)")
    add(
        "--duration",
        type=positive,
        default=30.0,
        metavar="S",
        help="simulated time to fly each of the thesis's tracks (default %(default)s)",
    )
    add(
        "--only",
        action="append",
        default=[],
        metavar="AREA",
        help="try only this: interface, memory, limits, optional, time, flights or restart; may be repeated",
    )
    add("--quiet", action="store_true", help="print failed checks only")


def run(args: Namespace) -> int:
    with loading():
        from colibri.conformance.check import check_by_command

    return check_by_command(args)
