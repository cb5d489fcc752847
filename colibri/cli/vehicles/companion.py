"""`colibri companion`."""

from argparse import Namespace
from math import inf
from pathlib import Path

from colibri.cli.shared.options import add_out
from colibri.common.process.arguments import ArgumentParser, natural, positive
from colibri.common.process.lifecycle import loading
from colibri.flights.spec import TRACK_HELP


def add_options(parser: ArgumentParser) -> None:
    add = parser.value
    mission = "or FILE.plan, a mission of QGroundControl: its waypoints, from the vehicle's home"
    hover = "what hover leaves out is as the vehicle has it"
    add("track", "TRACK", f"{TRACK_HELP}; {mission}; {hover}", nargs="?")
    reached = "how the vehicle is reached: udpin:, udpout:, tcp: or tcpin:HOST:PORT, or serial:DEVICE:BAUD"
    add("--vehicle", "URL", reached, required=True)
    add("--system", "ID", "MAVLink system id, where several are on the link", type=natural, default=0)
    add("--model", "NAME", "vehicle name or .toml that describes it (default: the profile's)")
    add("--profile", "NAME", "control profile name or .toml", default="flight")
    add("--controller", "NAME", "control law, also of another package (default: the profile's)")
    parser.flag("--arm", "arm and take off; without it a vehicle that flies is taken over")
    parser.flag("--dry-run", "ask, compute and log, but send neither setpoints nor orders")
    parser.flag("--identify", "hover, and measure in small steps how body rates follow commands")
    add("--response", "FILE", "companion.toml of an earlier --identify")
    stacks = ("px4", "ardupilot", "colibri")
    parser.add_argument("--stack", choices=stacks, help="autopilot of the vehicle (default: as in its heartbeat)")
    parser.add_argument(
        "--setpoints",
        default="rates",
        choices=("rates", "attitude", "velocity", "position"),
        help="setpoints to send; the last three for vehicles that accept no body rates (default %(default)s)",
    )
    add("--duration", "S", "time along the track (default: all of it)", type=positive, default=inf)
    add("--height", "M", "of the take-off (default: that of the track's first point)", type=positive)
    add("--wait", "S", "for vehicle and checks (default %(default)g)", type=positive, default=60.0)
    add("--margin", "M", "of the box around the track (default %(default)g)", type=positive, default=3.0)
    add("--max-tilt", "DEG", "ends the flight (default %(default)g)", type=positive, default=50.0)
    add("--max-error", "M", "from the reference (default %(default)g)", type=positive, default=1.5)
    add("--max-age", "MS", "of the newest state; ends the flight (default %(default)g)", type=positive, default=100.0)
    pace = "of the setpoints over a second, by a computer that keeps up; fewer end the flight (default %(default)g)"
    add("--min-pace", "PERCENT", pace, type=positive, default=80.0)
    add("--max-gap", "MS", "between two setpoints; ends the flight (default %(default)g)", type=positive, default=200.0)
    key = "sign messages, and refuse messages without a signature of this key"
    add("--signing-key", "FILE", key, type=Path)
    parser.flag("--insecure", "let links leave this computer without a key")
    add_out(parser, "out/companion", "logs and report")


def run(args: Namespace) -> int:
    with loading():
        from colibri.companion.process import fly

    return fly(args)
