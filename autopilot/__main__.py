"""`python -m autopilot`: the command line of the autopilot."""

import sys
from pathlib import Path

from mavlink.link import LinkError, open_link
from mavlink.process import ArgumentParser, Status, Stop, fail, use_one_thread

DEFAULT_PLANT = "udpout:127.0.0.1:14560"


def _parser() -> ArgumentParser:
    parser = ArgumentParser(
        prog="python -m autopilot",
        description="The autopilot: takes the vehicle's state from a plant and answers with rotor commands, "
        "over MAVLink/UDP. Start `python -m plant` in another terminal, before or after.",
        epilog="Example: python -m autopilot --track spiral",
    )
    add = parser.add_argument
    add("--plant", default=DEFAULT_PLANT, metavar="URL", help="the plant to call (default %(default)s)")
    add("--track", default="spiral", metavar="NAME", help="what to fly (default %(default)s)")
    add("--profile", default="thesis", metavar="NAME", help="control profile name or .toml (default %(default)s)")
    add("--controller", metavar="NAME", help="control law (default: the profile's)")
    add("--vehicle", metavar="NAME", help="vehicle name or .toml to control (default: the profile's)")
    add("--solver", metavar="NAME", help="QP solver of qpsolvers (default: the profile's)")
    add("--system-id", type=int, default=1, choices=range(1, 256), metavar="ID", help="MAVLink system (default 1)")
    add("--out", type=Path, metavar="DIR", help="write autopilot.csv (references, solver, times) there")
    add("--json", action="store_true", help="status as JSON lines on standard output")
    add("--with-parent", action="store_true", help="end when the process that started this one ends")
    return parser


def main() -> int:
    """Run the autopilot; return the exit code."""
    args = _parser().parse_args()
    use_one_thread()
    stop = Stop(with_parent=args.with_parent)
    status = Status("autopilot", as_json=args.json)
    try:
        link = open_link(args.plant)
    except LinkError as error:
        fail(str(error))
    from autopilot.process import run

    return run(args, link, status, stop)


if __name__ == "__main__":
    sys.exit(main())
