"""`colibri show`."""

import sys
from argparse import Namespace

from colibri.common.errors import Error
from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.lifecycle import fail


def add_options(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add("what", choices=("profile", "vehicle"), help="what to show")
    add("name", metavar="NAME", help="name of one that comes with Colibri; any other name lists them")


def run(args: Namespace) -> int:
    from colibri.autopilot.control.profile import profile_text
    from colibri.plant.vehicle.description import vehicle_text

    try:
        sys.stdout.write(profile_text(args.name) if args.what == "profile" else vehicle_text(args.name))
    except Error as error:
        fail(str(error))
    return 0
