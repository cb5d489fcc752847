"""`colibri fly`: its options, and its call."""

from argparse import Namespace

from colibri.cli.shared.options import add_feedback, add_out, add_signing
from colibri.common.process.arguments import ArgumentParser, natural, number, positive, speed
from colibri.plant.process.options import add_world_arguments

TRACK_HELP = (
    "the thesis's spiral, expanding-spiral, line, wave or crown; or, with options as KEY=VALUE[,KEY=VALUE...], "
    "hover[:x=0,y=0,height=2,yaw=0], lemniscate[:size=4,height=3,lap=6,yaw=path|fixed], "
    "circle[:radius=2,speed=2,height=2,yaw=path|fixed], waypoints:FILE[,speed=2], samples:FILE; m, s, degrees"
)


def add_options(parser: ArgumentParser) -> None:
    """Add the options of `colibri fly`."""
    add = parser.add_argument
    add("track", metavar="TRACK", help=TRACK_HELP)
    add("--profile", default="flight", metavar="NAME", help="control profile name or .toml (default %(default)s)")
    add("--controller", metavar="NAME", help="control law, also of another package (default: the profile's)")
    add(
        "--link",
        default="udp",
        choices=("udp", "memory", "direct"),
        help="udp: two processes (default); memory: one process, same codec, same flight; direct: without the codec",
    )
    add(
        "--gcs",
        action="append",
        default=[],
        metavar="URL",
        help="a ground station that may watch and command: udpout:, udpin:, tcp: or tcpin:HOST:PORT; may be repeated",
    )
    add_signing(add)
    add(
        "--speed",
        type=speed,
        metavar="N",
        help="times real time, or max (default: max; 1 where a ground station is invited by --gcs)",
    )
    add("--seed", type=natural, default=0, metavar="N", help="seed of everything random (default %(default)s)")
    add_feedback(add)
    add("--solver", metavar="NAME", help="QP solver of qpsolvers (default: the profile's)")
    add("--vehicle", metavar="NAME", help="vehicle name or .toml (default: the profile's)")
    add("--plant-vehicle", metavar="NAME", help="another vehicle for the plant alone, to fly what was not planned for")
    add("--floor", type=number, metavar="M", help="no track may lead below this height, m (default: the ground, 0)")
    add("--integrator", choices=("rk4", "adaptive"), help="of the plant (default: the profile's)")
    add_world_arguments(
        parser, start="the profile's, and the track's first yaw", of_whom=" of the plant; the autopilot keeps its own"
    )
    add("--duration", type=positive, default=100.0, metavar="S", help="simulated time (default %(default)s)")
    add_out(add, "out", "logs and figures")
    add("--no-figures", action="store_true", help="draw no PNG figures")


def run(args: Namespace) -> int:
    """Fly as the command line says; return the exit code."""
    from colibri.cli.shared.fly_and_report import fly

    return fly(args)
