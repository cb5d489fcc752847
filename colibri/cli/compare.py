"""`colibri compare`: its options, and its call."""

from argparse import ArgumentTypeError, Namespace

from colibri.cli.shared.options import add_feedback, add_out
from colibri.common.process.arguments import ArgumentParser, positive
from colibri.mavlink.hil.feedback import Feedback
from colibri.plant.environment.weather import NO_WIND
from colibri.plant.process.options import add_weather_arguments

COMPARED_S = 100.0


def in_another_world(args: Namespace) -> bool:
    """Whether the comparison leaves the thesis's world: chance, sensors, weather, another vehicle, two processes."""
    weather = args.wind is not NO_WIND or args.gusts or args.turbulence
    chance = args.seeds or args.feedback is Feedback.SENSORS
    return bool(args.resume or chance or weather or args.vehicle or args.link == "udp" or args.duration != COMPARED_S)


def seeds(text: str) -> range:
    """Read FIRST-LAST of the command line."""
    first, _, last = text.partition("-")
    try:
        chosen = range(int(first), int(last or first) + 1)
    except ValueError:
        chosen = range(0)
    if not chosen:
        raise ArgumentTypeError(f"expected FIRST-LAST, 1-50 say, not {text}")
    return chosen


def add_options(parser: ArgumentParser) -> None:
    """Add the options of `colibri compare`."""
    add = parser.add_argument
    add(
        "--profile",
        action="append",
        metavar="NAME[:CONTROLLER]",
        help="a profile, or another controller with it; may be repeated (default: thesis, thesis-euler, "
        "thesis:global-lpv-mpc, se3)",
    )
    add("--track", action="append", metavar="TRACK", help="a track; may be repeated (default: the thesis's five)")
    add(
        "--link",
        default="memory",
        choices=("memory", "direct", "udp"),
        help="one process, with or without the codec; or two (default %(default)s)",
    )
    add("--seeds", type=seeds, metavar="FIRST-LAST", help="fly each by all of these seeds, and show how errors spread")
    add("--resume", action="store_true", help="with --seeds: do not fly again what --out has already")
    add_feedback(add)
    add("--vehicle", metavar="NAME", help="vehicle name or .toml (default: the profile's)")
    add("--duration", type=positive, default=COMPARED_S, metavar="S", help="simulated time (default %(default)s)")
    add_weather_arguments(parser)
    add_out(add, "out/compare", "the tables")


def run(args: Namespace) -> int:
    """Compare as the command line says; return the exit code."""
    if in_another_world(args):
        from colibri.studies.seeds import compare_seeds

        return compare_seeds(args)
    from colibri.studies.compare import compare

    return compare(args)
