"""`colibri fly`: its options, and its call."""

from argparse import Namespace

from colibri.analysis.limits import limit
from colibri.cli.shared.options import add_flight_options, add_out, add_signing
from colibri.common.process.arguments import ArgumentParser, speed
from colibri.common.process.lifecycle import loading

TRACK_HELP = (
    "the thesis's spiral, expanding-spiral, line, wave or crown; or, with options as KEY=VALUE[,KEY=VALUE...], "
    "hover[:x=0,y=0,height=2,yaw=0], lemniscate[:size=4,height=3,lap=6,yaw=path|fixed], "
    "circle[:radius=2,speed=2,height=2,yaw=path|fixed], waypoints:FILE[,speed=2|max,margin=0.1], "
    "samples:FILE; m, s, degrees"
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
    add_flight_options(parser)
    add_out(add, "out", "logs and figures")
    add(
        "--fail-above",
        type=limit,
        action="append",
        default=[],
        metavar="[KEY=]VALUE",
        help="exit with 1 if a number of report.json is larger: of rmse_after_20s_m (m), or another by its KEY, "
        "ground_contact_s=0 say; may be repeated",
    )
    add("--no-figures", action="store_true", help="draw no PNG figures")


def run(args: Namespace) -> int:
    """Fly as the command line says; return the exit code."""
    with loading():
        from colibri.cli.shared.fly_and_report import fly

    return fly(args)
