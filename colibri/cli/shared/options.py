"""Options that several subcommands share."""

from collections.abc import Callable
from pathlib import Path

from colibri.autopilot.process.options import add_delay
from colibri.common.process.arguments import ArgumentParser, natural, number, positive
from colibri.mavlink.hil.feedback import Feedback, feedback
from colibri.plant.process.options import add_world_arguments


def add_feedback(add: Callable[..., object]) -> None:
    """Add what the autopilot flies by."""
    add(
        "--feedback",
        type=feedback,
        default=Feedback.STATE,
        metavar="state|sensors",
        help="what the autopilot flies by: the true state (default), or what sensors measure",
    )


def add_flight_options(parser: ArgumentParser) -> None:
    """Add what every command takes that flies: vehicles, solver, integrator, feedback, weather, chance, time."""
    add = parser.add_argument
    add("--seed", type=natural, default=0, metavar="N", help="seed of everything random (default %(default)s)")
    add_feedback(add)
    add("--solver", metavar="NAME", help="QP solver of qpsolvers (default: the profile's)")
    add_delay(add)
    add("--vehicle", metavar="NAME", help="vehicle name or .toml (default: the profile's)")
    add("--plant-vehicle", metavar="NAME", help="another vehicle for the plant alone, to fly what was not planned for")
    add("--floor", type=number, metavar="M", help="no track may lead below this height, m (default: the ground, 0)")
    add("--integrator", choices=("rk4", "adaptive"), help="of the plant (default: the profile's)")
    add_world_arguments(
        parser, start="the profile's, and the track's first yaw", of_whom=" of the plant; the autopilot keeps its own"
    )
    add("--duration", type=positive, default=100.0, metavar="S", help="simulated time (default %(default)s)")


def add_signing(add: Callable[..., object]) -> None:
    """Add the key of links, and leave to do without."""
    add("--signing-key", type=Path, metavar="FILE", help="sign what is sent, refuse what is not signed with this key")
    add("--insecure", action="store_true", help="let links leave this computer without a key")


def add_out(add: Callable[..., object], folder: str, what: str) -> None:
    """Add the folder that takes `what`, `folder` where it is not named, and leave to be quiet."""
    add("--out", type=Path, default=Path(folder), metavar="DIR", help=f"folder for {what} (default %(default)s)")
    add("--quiet", action="store_true", help="say nothing but errors")
