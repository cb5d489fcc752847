"""`colibri companion`."""

from argparse import Namespace
from math import inf

from colibri.cli.shared.options import add_out, add_signing
from colibri.common.process.arguments import ArgumentParser, natural, positive
from colibri.common.process.lifecycle import loading
from colibri.flights.spec import TRACK_HELP


def add_options(parser: ArgumentParser) -> None:
    add = parser.add_argument
    mission = "or FILE.plan, a mission of QGroundControl: its waypoints, from the vehicle's home"
    hover = "what hover leaves out is as the vehicle has it"
    add("track", metavar="TRACK", nargs="?", help=f"{TRACK_HELP}; {mission}; {hover}")
    add(
        "--vehicle",
        required=True,
        metavar="URL",
        help="how the vehicle is reached: udpin:, udpout:, tcp: or tcpin:HOST:PORT, or serial:DEVICE:BAUD",
    )
    add("--system", type=natural, default=0, metavar="ID", help="MAVLink system id, where several are on the link")
    add("--model", metavar="NAME", help="vehicle name or .toml that describes it (default: the profile's)")
    add("--profile", default="flight", metavar="NAME", help="control profile name or .toml (default %(default)s)")
    add("--controller", metavar="NAME", help="control law, also of another package (default: the profile's)")
    add("--arm", action="store_true", help="arm and take off; without it a vehicle that flies is taken over")
    add("--dry-run", action="store_true", help="ask, compute and log, but send neither setpoints nor orders")
    add(
        "--identify",
        action="store_true",
        help="hover, and measure in small steps how body rates follow commands",
    )
    add("--response", metavar="FILE", help="companion.toml of an earlier --identify")
    add(
        "--stack",
        choices=("px4", "ardupilot", "colibri"),
        help="autopilot of the vehicle (default: as in its heartbeat)",
    )
    add(
        "--setpoints",
        default="rates",
        choices=("rates", "attitude", "velocity", "position"),
        help="setpoints to send; the last three for vehicles that accept no body rates (default %(default)s)",
    )
    add("--duration", type=positive, default=inf, metavar="S", help="time along the track (default: all of it)")
    add("--height", type=positive, metavar="M", help="of the take-off (default: that of the track's first point)")
    add("--wait", type=positive, default=60.0, metavar="S", help="for vehicle and checks (default %(default)g)")
    add("--margin", type=positive, default=3.0, metavar="M", help="of the box around the track (default %(default)g)")
    add("--max-tilt", type=positive, default=50.0, metavar="DEG", help="ends the flight (default %(default)g)")
    add("--max-error", type=positive, default=1.5, metavar="M", help="from the reference (default %(default)g)")
    add(
        "--max-age",
        type=positive,
        default=100.0,
        metavar="MS",
        help="of the newest state; ends the flight (default %(default)g)",
    )
    add(
        "--min-pace",
        type=positive,
        default=80.0,
        metavar="PERCENT",
        help="of the setpoints over a second, by a computer that keeps up; fewer end the flight (default %(default)g)",
    )
    add(
        "--max-gap",
        type=positive,
        default=200.0,
        metavar="MS",
        help="between two setpoints; ends the flight (default %(default)g)",
    )
    add_signing(add)
    add_out(add, "out/companion", "logs and report")


def run(args: Namespace) -> int:
    with loading():
        from colibri.companion.process import fly

    return fly(args)
