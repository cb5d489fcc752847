"""`colibri check-controller`."""

from argparse import Namespace

from colibri.common.process.arguments import ArgumentParser, natural, positive
from colibri.common.process.lifecycle import loading


def add_options(parser: ArgumentParser) -> None:
    add = parser.value
    add("name", "NAME", "control law, also of another package")
    add("--profile", "NAME", "control profile name or .toml (default: the one with numbers for the law)")
    add("--vehicle", "NAME", "vehicle name or .toml (default: the profile's)")
    add("--seed", "N", "seed of everything random (default %(default)s)", type=natural, default=0)
    add("--duration", "S", "simulated time to fly each of the thesis's tracks", type=positive, default=30.0)
    parser.several("--only", "AREA", "try only this: interface, memory, limits, optional, time, flights or restart")
    parser.flag("--quiet", "print failed checks only")


def run(args: Namespace) -> int:
    with loading():
        from colibri.conformance.check import check_by_command

    return check_by_command(args)
