"""`colibri autopilot`: the command line of the autopilot."""

import sys
from collections.abc import Sequence
from pathlib import Path

from colibri.autopilot.process.options import add_delay
from colibri.common.earth.home import DEFAULT_HOME, home
from colibri.common.process.arguments import ArgumentParser, add_common_arguments
from colibri.mavlink.hil.feedback import Feedback, feedback
from colibri.mavlink.links.link import BlockingReceiver
from colibri.mavlink.links.open import open_ground_link, open_link
from colibri.mavlink.links.startup import begin, report_compiling

DEFAULT_PLANT = "udpout:127.0.0.1:14560"


def command_line() -> ArgumentParser:
    """Return what reads the command line."""
    parser = ArgumentParser(
        prog="colibri autopilot",
        description="The autopilot: takes the vehicle's state, or what its sensors measure, from a plant and answers "
        "with rotor commands, over MAVLink/UDP. Start `colibri plant` in another terminal, before or after.",
        epilog="Example: colibri autopilot --track spiral",
    )
    add = parser.add_argument
    add("--plant", default=DEFAULT_PLANT, metavar="URL", help="the plant to call (default %(default)s)")
    add(
        "--simulator",
        metavar="URL",
        help="fly a simulator that speaks PX4's interface instead, jMAVSim say: tcp:127.0.0.1:4560; on its sensors",
    )
    add("--track", metavar="TRACK", help="what to fly, as in `colibri fly` (default spiral; with --gcs: what is asked)")
    add("--floor", type=float, metavar="M", help="height below which no track may lead, m (default: the ground, 0)")
    add("--profile", default="flight", metavar="NAME", help="control profile name or .toml (default %(default)s)")
    add("--controller", metavar="NAME", help="control law (default: the profile's)")
    add("--vehicle", metavar="NAME", help="vehicle name or .toml to control (default: the profile's)")
    add(
        "--feedback",
        type=feedback,
        default=Feedback.STATE,
        metavar="state|sensors",
        help="what to ask the plant for: the true state (default), or what sensors measure",
    )
    add("--solver", metavar="NAME", help="QP solver of qpsolvers (default: the profile's)")
    add_delay(add)
    add(
        "--gcs",
        action="append",
        default=[],
        metavar="URL",
        help="a ground station: udpout:, udpin:, tcp:, tcpin: or serial:",
    )
    add("--stepped", metavar="URL", help="a program that speaks for all ground stations, frame by frame (for tests)")
    add("--home", type=home, default=DEFAULT_HOME, metavar="LAT,LON,ALT,YAW", help="the origin (default %(default)s)")
    add("--identity", default="px4", choices=("px4", "generic"), help="towards ground stations (default %(default)s)")
    add("--state", type=Path, metavar="DIR", help="keeps parameters, logs, files (default: nothing is kept)")
    add("--signing-key", type=Path, metavar="FILE", help="sign what is sent, refuse what is not signed with this key")
    add("--insecure", action="store_true", help="let links leave this computer without a key")
    add("--strict", action="store_true", help="end by what a part raises in flight; default: it is replaced, flown on")
    add_common_arguments(parser, "autopilot.csv (references, solver, times) and flight.ulg")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run the autopilot; return the exit code."""
    args = command_line().parse_args(argv)
    if args.simulator is None:
        link, status, stop = begin("autopilot", args.plant, args, open_link)
        report_compiling(status)
        from colibri.autopilot.process.run import run

        return run(args, link, status, stop)
    args.feedback = Feedback.SENSORS
    simulator, status, stop = begin("autopilot", args.simulator, args, open_ground_link)
    report_compiling(status)
    from colibri.autopilot.process.run import run

    return run(args, BlockingReceiver(simulator), status, stop)


if __name__ == "__main__":
    sys.exit(main())
