"""`colibri plant`: the command line of the plant. It listens before it loads what takes time to load."""

import sys
from collections.abc import Sequence
from math import inf

from colibri.common.earth.home import DEFAULT_HOME, home
from colibri.common.process.arguments import ArgumentParser, add_common_arguments, natural, positive, speed
from colibri.common.process.lifecycle import fail
from colibri.mavlink.links.open import open_ground_link, open_link
from colibri.mavlink.links.startup import begin, report_compiling
from colibri.plant.process.options import add_world_arguments
from colibri.plant.process.reports import awaiting

DEFAULT_LINKS = {
    "colibri": "udpin:127.0.0.1:14560",
    "ardupilot-json": "udpin:127.0.0.1:9002",
    "px4": "tcpin:127.0.0.1:4560",
}


def command_line() -> ArgumentParser:
    """Return what reads the command line."""
    parser = ArgumentParser(
        prog="colibri plant",
        description="The quadrotor and its world: integrates the nonlinear vehicle, sends its state, or what its "
        "sensors measure, as the autopilot asks, and takes rotor commands over MAVLink/UDP. In lockstep, unless "
        "--realtime: it waits for each answer, however long that takes. "
        "Start `colibri autopilot` in another terminal, before or after.",
        epilog="Example: colibri plant --duration 100 --out out/flight",
    )
    add = parser.add_argument
    add(
        "--serve",
        default="colibri",
        choices=DEFAULT_LINKS,
        help="colibri: colibri autopilot (default); ardupilot-json: ArduPilot's SITL, started with --model JSON, "
        "which sets rate and speed itself; px4: PX4's SITL, over TCP, or UDP where it waits to be called (udpout:)",
    )
    links = ", ".join(f"{url} for {whom}" for whom, url in DEFAULT_LINKS.items())
    add("--link", metavar="URL", help=f"where to wait for the autopilot (default {links})")
    add("--vehicle", default="hummingbird", metavar="NAME", help="vehicle name or .toml (default %(default)s)")
    add(
        "--integrator",
        default="rk4",
        choices=("rk4", "adaptive"),
        help="rk4: fixed steps of 1 ms (default); adaptive: Dormand-Prince to 1e-9",
    )
    add_world_arguments(parser, start="y=-1,z=2,psi=90,rotors=4740, all else 0; on sensors y=-1,psi=90")
    add("--seed", type=natural, default=0, metavar="N", help="seed of everything random (default %(default)s)")
    add("--home", type=home, default=DEFAULT_HOME, metavar="LAT,LON,ALT,YAW", help="the origin (default %(default)s)")
    add("--rate", type=positive, default=250.0, metavar="HZ", help="frames, if the autopilot asks for no other rate")
    add(
        "--realtime",
        action="store_true",
        help="run freely, as hardware would: follow the wall clock, wait for no answer, hold the last command",
    )
    add(
        "--cut-after",
        type=positive,
        default=0.5,
        metavar="S",
        help="with --realtime: stop the rotors where no command comes for so long (default %(default)s)",
    )
    add("--duration", type=positive, default=inf, metavar="S", help="end after this simulated time (default: never)")
    add("--speed", type=speed, metavar="N", help="times real time, or max (default: max; with --realtime 1)")
    add(
        "--truth", action="store_true", help="append the true state to each frame, for a program in between (for tests)"
    )
    add_common_arguments(parser, "plant.csv (truth at every frame), flight.tlog and flight.ulg")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run the plant; return the exit code."""
    args = command_line().parse_args(argv)
    if args.realtime and (args.serve != "colibri" or args.speed == inf):
        fail("--realtime follows the wall clock for `colibri autopilot`: no --serve beside it, and no --speed max")
    args.speed = args.speed or (1.0 if args.realtime else inf)
    url = args.link or DEFAULT_LINKS[args.serve]
    if args.serve == "px4":
        link_to_px4, status, stop = begin("plant", url, args, open_ground_link)
        event = "listening" if link_to_px4.target is None else "calling"
        status.say(event, awaiting("PX4", link_to_px4), url=link_to_px4.url)
        report_compiling(status)
        from colibri.plant.process.px4_server import run as serve_px4

        return serve_px4(args, link_to_px4, status, stop)
    link, status, stop = begin("plant", url, args, open_link)
    if link.target is not None:
        fail(f"{url}: the plant calls PX4 alone; others call it: give --link udpin:HOST:PORT")
    whom = "ArduPilot" if args.serve == "ardupilot-json" else "an autopilot"
    status.say("listening", awaiting(whom, link), url=link.url)
    report_compiling(status)
    if args.serve == "ardupilot-json":
        from colibri.plant.process.ardupilot_server import run
    else:
        from colibri.plant.process.run import run

    return run(args, link, status, stop)


if __name__ == "__main__":
    sys.exit(main())
