"""`colibri vehicle`."""

import shlex
import sys
from argparse import Namespace
from pathlib import Path

from colibri.common.errors import Error
from colibri.common.files import write_bytes
from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.lifecycle import fail


def add_options(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add("name", metavar="NAME", help="vehicle name or .toml")
    add(
        "--for",
        required=True,
        choices=("px4", "ardupilot"),
        dest="whom",
        help="px4: a file that QGroundControl loads; ardupilot: one that SITL, MAVProxy and Mission Planner load",
    )
    add("--out", type=Path, metavar="FILE", help="where to write (default: standard output)")


def run(args: Namespace) -> int:
    from colibri.plant.vehicle.description import load_vehicle
    from colibri.plant.vehicle.parameter_files import FILES

    try:
        vehicle = load_vehicle(args.name)
        text = FILES[args.whom](
            vehicle, f"{vehicle.name}, by colibri vehicle {shlex.quote(args.name)} --for {args.whom}"
        )
    except Error as error:
        fail(str(error))
    if args.out is None:
        sys.stdout.write(text)
        return 0
    try:
        args.out.parent.mkdir(parents=True, exist_ok=True)
        write_bytes(args.out, text.encode())
    except OSError as error:
        fail(f"cannot write {args.out}: {error.strerror}")
    return 0
